/* The variable table of a scene, and getting and setting by it. The table itself is generated (scene.c). Values live in
   now.values, by value reference; what is set is judged where it is first used (composite.c). */
#ifndef VARIABLES_H
#define VARIABLES_H

#include "instance.h"

typedef enum { TYPE_NUMBER, TYPE_BOOLEAN } Type;

typedef enum { ROLE_TIME, ROLE_INPUT, ROLE_PARAMETER, ROLE_OUTPUT, ROLE_STATE, ROLE_DERIVATIVE } Role;

/* What a value must be beside finite. A check stands at the first element of what is judged together. */
typedef enum {
    CHECK_NONE,
    CHECK_MASS,   /* >= 0 */
    CHECK_PMI,    /* three moments >= 0; unless the scene says otherwise they obey the triangle inequality */
    CHECK_PORT    /* direction[3] and alignment[3]: lengths > 0, not parallel */
} Check;

/* What must be current before a variable is read, as bits. */
enum {
    FOLLOWS_COMPOSITE = 1,
    FOLLOWS_STATES = 2,
    FOLLOWS_ATTITUDE = 4, /* the attitude among the states */
    FOLLOWS_OUTPUTS = 8,
    FOLLOWS_RATES = 16,
    FOLLOWS_AXES = 32
};

typedef struct {
    const char *name;
    const char *unit;
    double start;
    double nominal;
    Role role;
    unsigned follows;
    Type type; /* the values of a Boolean are 0 and 1 */
} Variable;

/* A check and the value reference at which it stands; the last one is CHECK_NONE. */
typedef struct {
    unsigned reference;
    Check check;
} Judged;

extern const Judged JUDGED[];

/* Indexed by value reference: time, inputs (p, then torque), parameters, outputs, states, derivatives. */
extern const Variable VARIABLES[VARIABLE_COUNT];

extern const char MODEL_TOKEN[];

/* Gets or sets values by value reference, all of them or none. */
Status instance_get(Instance *instance, const unsigned references[], size_t count, double values[]);
Status instance_set(Instance *instance, const unsigned references[], size_t count, const double values[]);

/* Whether references are of the table. */
Status instance_check_references(Instance *instance, const unsigned references[], size_t count);

/* Refuses a reference that is not. */
Status instance_unknown_reference(Instance *instance, unsigned reference);

static inline bool is_boolean(unsigned reference) {
    return DOCK_COUNT > 0 && VARIABLES[reference].type == TYPE_BOOLEAN;
}

/* Whether the state has an attitude that can be brought to unit length; a solver may have lost it. */
Status instance_check_attitude(Instance *instance);

/* Continuous states of model exchange, in the order of the table. */
Status instance_set_time(Instance *instance, double time);
Status instance_get_states(Instance *instance, double states[], size_t count);
Status instance_set_states(Instance *instance, const double states[], size_t count);
Status instance_get_rates(Instance *instance, double rates[], size_t count);
Status instance_get_nominals(Instance *instance, double nominals[], size_t count);

/* Whether products of a few of these numbers are doubles. */
bool are_ordinary(const double numbers[], size_t count);

/* Whether all that follows from states, inputs and composite surely is within the range of doubles. */
bool instance_is_ordinary(Instance *instance);

#endif
