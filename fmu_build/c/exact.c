/* The plan of the propagator exact: every communication step is free motion, and what acts is refused. */
#include <string.h>

#include "free_step.h"
#include "variables.h"

/* Names what keeps the motion from being free. */
static Status refuse_action(Instance *instance) {
    static const char reason[] = "must be 0 for the propagator exact, which knows free motion alone";
    for (size_t i = REFERENCE_TORQUE; i < REFERENCE_TORQUE + INPUT_U_COUNT; i += 3) {
        const double *v = &instance->now.values[i];
        if (v[0] == 0.0 && v[1] == 0.0 && v[2] == 0.0) continue;
        const Variable *variable = &VARIABLES[i];
#if FIELD
        if (i >= REFERENCE_TORQUE + FIELD_PLACE)
            return instance_refuse(instance,
                                   "%.*s = (%.10g, %.10g, %.10g) m: gravity's gradient acts there, and the propagator "
                                   "exact knows free motion alone; take taylor or dop853",
                                   group_length(variable), variable->name, v[0], v[1], v[2]);
#endif
        return instance_refuse(instance, "%.*s = (%.10g, %.10g, %.10g) %s: %s", group_length(variable),
                               variable->name, v[0], v[1], v[2], variable->unit, reason);
    }
    if (!SPINS) return STATUS_OK;
    const double *h = &instance->now.c[COMPOSITE_SPIN];
    return instance_refuse(instance, "the ports that move give the vessels (%.10g, %.10g, %.10g) N.m.s: %s", h[0], h[1],
                           h[2], reason);
}

Status solver_advance(Instance *instance, Progress *progress) {
    progress->was_free = is_free(instance);
    if (progress->was_free) return free_step(instance, progress, composite_changed(instance));
    return refuse_action(instance);
}
