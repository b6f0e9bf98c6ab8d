/* The bound of what law and method are off by, carried along a flight in co-simulation: see model/docs/error_bound.md.
   An FMU whose scene shows it has error_bound.c; in the others nothing is left of these. */
#ifndef ERROR_BOUND_H
#define ERROR_BOUND_H

#include "solver.h"

#if ERROR_BOUND

/* The bound begins at zero, from inputs and rate as they are; in model exchange, where the importer's solver integrates,
   nothing is known. */
void bound_start(Instance *instance);

/* Takes the bound over a change of inputs from those of the last step or event, which stand in stepped_p, to those that
   p, c and the rate follow from now. */
void bound_over_change(Instance *instance);

/* Takes the bound over a sub-step of `size` [s] from x; progress is as the sub-step left it. */
void bound_over_sub_step(Instance *instance, const double x[], double size, const Progress *progress);

/* The next change begins from inputs and rate as they are. */
void bound_remember(Instance *instance);

#else

static inline void bound_start(Instance *instance) {
    (void)instance;
}
static inline void bound_over_change(Instance *instance) {
    (void)instance;
}
static inline void bound_over_sub_step(Instance *instance, const double x[], double size, const Progress *progress) {
    (void)instance, (void)x, (void)size, (void)progress;
}
static inline void bound_remember(Instance *instance) {
    (void)instance;
}

#endif

#endif
