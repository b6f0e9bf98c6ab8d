/* Partial derivatives of outputs and rates by inputs and states, at what the outputs are now; in INITIALIZATION of
   outputs, states and rates by inputs and parameters. */
#ifndef DERIVATIVES_H
#define DERIVATIVES_H

#include "instance.h"

/* Sensitivity of unknowns to a change (seed) of knowns. */
Status derivatives_forward(Instance *instance, const unsigned unknowns[], size_t unknown_count,
                           const unsigned knowns[], size_t known_count, const double seed[], double sensitivity[]);

/* Sensitivity of the seed-weighted sum of unknowns to each known. */
Status derivatives_adjoint(Instance *instance, const unsigned unknowns[], size_t unknown_count,
                           const unsigned knowns[], size_t known_count, const double seed[], double sensitivity[]);

/* Derivatives of outputs with respect to time, inputs held; orders must be 1. */
Status derivatives_of_time(Instance *instance, const unsigned references[], size_t count, const int orders[],
                           double values[]);

#endif
