/* What masses and poses keep when they change, as the scene says: momentum (kept_momentum.c, its derivatives
   kept_derivatives.c) or the rate alone (kept_rate.c). */
#ifndef KEPT_IN_CHANGES_H
#define KEPT_IN_CHANGES_H

#include "changes.h"

/* Gives the angular velocity after docks have opened and masses and poses have changed, and before docks close; p are
   the new inputs, c their composite. */
Status rate_on_the_way(Instance *instance, const double p[], const double c[], double rate[RATE_COUNT]);

/* Carries a small change of the rate [rad/s] over that way, adding what those of the inputs add. Reverse: carries
   weights on the rate back over it, and adds to those on the inputs. */
Status rate_on_the_way_forward(Instance *instance, const Variation *v, double change[RATE_COUNT]);
Status rate_on_the_way_reverse(Instance *instance, double weight[RATE_COUNT], Variation *v);

/* The small change dc of the composite of p by those of the inputs of some kinds; change_derivatives.c has it. Reverse:
   adds to the weights on inputs of some kinds those that follow from weights wc on the composite. */
void change_composite(Instance *instance, const double p[], const Variation *v, unsigned kinds, double dc[]);
void weigh_inputs(Instance *instance, const double p[], const double wc[], unsigned kinds, Variation *v);

#endif
