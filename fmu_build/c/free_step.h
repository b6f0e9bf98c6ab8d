/* A communication step of free motion, counted from the instant at which the motion became free. */
#ifndef FREE_STEP_H
#define FREE_STEP_H

#include <string.h>

#include "solver.h"

/* Whether nothing acts on the body. */
bool is_free(const Instance *instance);

/* Whether the composite has changed since the last communication step. */
static inline bool composite_changed(const Instance *instance) {
    return memcmp(instance->now.p, instance->now.stepped_p, sizeof instance->now.p) != 0;
}

/* Takes the whole step from where the motion became free, so that rounding does not pile up over steps; or, if that is
   too many turns away, or the composite has changed since the last step, from now on. */
Status free_step(Instance *instance, Progress *progress, bool changed);

#endif
