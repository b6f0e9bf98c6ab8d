/* What masses and poses keep when they change, as the scene says: momentum (kept_momentum.c) or the rate alone
   (kept_rate.c). */
#ifndef KEPT_IN_CHANGES_H
#define KEPT_IN_CHANGES_H

#include "changes.h"

/* Gives the angular velocity after docks have opened and masses and poses have changed, and before docks close; p are
   the new inputs, c their composite. */
Status rate_on_the_way(Instance *instance, const double p[], const double c[], double rate[3]);

#endif
