/* The form of a scene's variable table, of what is judged among its inputs, and of its token; generated: scene.c. */
#ifndef VARIABLE_TABLE_H
#define VARIABLE_TABLE_H

#include <string.h>

#include "scene.h"

typedef enum { TYPE_NUMBER, TYPE_BOOLEAN } Type;

typedef enum { ROLE_TIME, ROLE_INPUT, ROLE_PARAMETER, ROLE_OUTPUT, ROLE_STATE, ROLE_DERIVATIVE } Role;

/* What a value must be beside finite. A check stands at the first element of what is judged together. */
typedef enum {
    CHECK_NONE,
    CHECK_MASS,   /* >= 0 */
    CHECK_PMI,    /* three moments >= 0; unless the scene says otherwise they obey the triangle inequality */
    CHECK_PORT,   /* direction[3] and alignment[3]: lengths > 0, not parallel */
    CHECK_MASS_OF_WHEELS /* > 0 */
} Check;

/* What must be current before a variable is read, as bits. */
enum {
    FOLLOWS_COMPOSITE = 1,
    FOLLOWS_STATES = 2,
    FOLLOWS_ATTITUDE = 4, /* the attitude among the states */
    FOLLOWS_OUTPUTS = 8,
    FOLLOWS_RATES = 16,
    FOLLOWS_AXES = 32,
    FOLLOWS_FIELD = 64 /* where the body is in a field of gravity */
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

/* Length of the name of a vector without the index of an element. */
static inline int group_length(const Variable *element) {
    return (int)(strrchr(element->name, INDEX_MARK) - element->name);
}

/* A check and the value reference at which it stands; the last one is CHECK_NONE. */
typedef struct {
    unsigned reference;
    Check check;
} Judged;

extern const Judged JUDGED[];

/* Indexed by value reference: time, inputs (p, then torque), parameters, outputs, states, derivatives. */
extern const Variable VARIABLES[VARIABLE_COUNT];

extern const char MODEL_TOKEN[];

#endif
