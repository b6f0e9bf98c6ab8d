/* What methods have in common that find the size of their sub-steps by an estimated error. */
#ifndef ESTIMATED_STEPS_H
#define ESTIMATED_STEPS_H

#include <string.h>

#include "field.h"
#include "solver.h"

/* From one sub-step to the next the size grows by this factor at most: by it too where the error is less than the share
   NO_ERROR of what is allowed, whose quotient need not be a double. */
static const double MOST_GROWTH = 5.0, NO_ERROR = 0x1p-300;

static const double MOST_SUB_STEPS = 1e6; /* of about ten times the work of those that rk4 takes */

/* Refuses a step that needs so many sub-steps. */
Status estimated_refuse_count(Instance *instance, const Progress *progress, double count);

/* Size of the first sub-step [s] where the rate of the state limits it. */
double estimated_first_size(Instance *instance, const Progress *progress);

/* The size nearest to one whose difference from what remains is a double: times of sub-steps then add up exactly. */
static inline double without_rest(const Progress *progress, double size) {
    return progress->remaining - (progress->remaining - size);
}

/* Size of the next sub-step [s] by what is known before it. */
static inline double planned_size(const Progress *progress) {
    const double size = progress->next_size;
    if (!(size < progress->remaining)) return progress->remaining;
    return 2.0 * size > progress->remaining ? 0.5 * progress->remaining : without_rest(progress, size);
}

/* Goes on to next, by a sub-step of that size with an error that is estimated. */
static inline void go_on(Instance *instance, Progress *progress, const double next[], double size, double error) {
    progress->error += error;
    memcpy(instance_x(instance), next, STATE_COUNT * sizeof(double));
    field_move(instance);
    progress->remaining = size < progress->remaining ? progress->remaining - size : 0.0;
}

#endif
