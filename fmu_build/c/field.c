/* What is allowed of the body's place in a field of gravity. */
#include "field.h"

#include <math.h>

#include "variables.h"

static Status refuse(Instance *instance, size_t reference, const char *allowed, double limit,
                     const char *which) {
    const double *v = &instance->now.values[reference];
    const Variable *variable = &VARIABLES[reference];
    return instance_refuse(instance, "%.*s = (%.10g, %.10g, %.10g) %s: must be %s %.6g %s%s", group_length(variable),
                           variable->name, v[0], v[1], v[2], variable->unit, allowed, limit, variable->unit, which);
}

/* The gradient is of first order in the body's size over the distance: as a body's size stands the root of tr J/mass. */
Status field_check(Instance *instance) {
    enum { POSITION = REFERENCE_TORQUE + FIELD_PLACE, VELOCITY = POSITION + 3 };
    const double *r = &instance->now.values[POSITION], *c = instance->now.c, *J = &c[COMPOSITE_INERTIA];
    if (!are_within(r, 3, LARGEST_PLACE)) return refuse(instance, POSITION, "at most", LARGEST_PLACE, " long");
    if (!are_within(r + 3, 3, LARGEST_PLACE)) return refuse(instance, VELOCITY, "at most", LARGEST_PLACE, " long");
    const double nearest = 4.0 * (J[0] / c[COMPOSITE_MASS] + J[1] / c[COMPOSITE_MASS] + J[2] / c[COMPOSITE_MASS]);
    const double square = r[0] * r[0] + r[1] * r[1] + r[2] * r[2];
    if (square > nearest) return STATUS_OK;
    return refuse(instance, POSITION, "longer than", sqrt(nearest), ", twice the assembly's size");
}
