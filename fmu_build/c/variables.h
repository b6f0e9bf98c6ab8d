/* Getting and setting by the variable table. Values live in now.values, by value reference; what is set is judged where
   it is first used (composite.c). */
#ifndef VARIABLES_H
#define VARIABLES_H

#include "instance.h"
#include "variable_table.h"

/* Gets or sets values by value reference, all of them or none. */
Status instance_get(Instance *instance, const unsigned references[], size_t count, double values[]);
Status instance_set(Instance *instance, const unsigned references[], size_t count, const double values[]);

/* Whether references are of the table. */
Status instance_check_references(Instance *instance, const unsigned references[], size_t count);

/* Logs an error for a reference that is not. */
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

/* Whether all of these numbers are of a size up to the limit. */
bool are_within(const double numbers[], size_t count, double limit);

/* The size of numbers up to which products of a few surely are doubles. */
static const double ORDINARY = 0x1p150;

/* Sizes of composite, moments and axes up to which the bound of the error is computed without precautions. */
static const double TAME_CONSTANTS = 0x1p50;

/* Whether all that follows from states, inputs and composite surely is within the range of doubles. */
bool instance_is_ordinary(Instance *instance);

#endif
