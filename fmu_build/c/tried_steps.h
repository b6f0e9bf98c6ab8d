/* Sub-steps that are tried: one whose estimated error is too large is taken again, shorter. */
#ifndef TRIED_STEPS_H
#define TRIED_STEPS_H

#include "estimated_steps.h"

/* Calls the model's step from x by size [s].
   next  : the state there
   error : estimates of the attitude's [rad] and the rate's [rad/s] */
void tried_call(Instance *instance, const double x[], double size, double next[], double error[2]);

/* The method's own, whose file defines them: the size of a first sub-step [s], and one sub-step from the instance's
   state, as of tried_call. */
double tried_first_size(Instance *instance, const Progress *progress);
Status tried_step(Instance *instance, double size, double next[], double error[2]);

#endif
