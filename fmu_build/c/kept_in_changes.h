/* What masses and poses keep when they change, as the scene says: momentum (kept_momentum.c) or the rate alone
   (kept_rate.c). */
#ifndef KEPT_IN_CHANGES_H
#define KEPT_IN_CHANGES_H

#include "changes.h"

/* Gives the angular velocity after docks have opened and masses and poses have changed, and before docks close; p are
   the new inputs, c their composite. */
Status rate_on_the_way(Instance *instance, const double p[], const double c[], double rate[3]);

/* Inputs on the way of a change, and their composite once it is asked for. */
typedef struct {
    double p[INPUT_P_COUNT], c[COMPOSITE_COUNT];
    bool c_is_current;
} Stage;

/* Where a change to p begins: all as committed, but for the docks that open. */
void first_stage(const Instance *instance, const double p[], Stage *stage);

/* Lets inputs of some kinds be as in p, docks open. */
bool move_stage(Stage *stage, const double p[], unsigned kinds);

/* Makes a stage's composite current, and judges it. */
Status weigh_stage(Instance *instance, Stage *stage);

#endif
