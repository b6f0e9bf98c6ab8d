/* The stages of a change of inputs at one instant: docks open, masses and moments change, then poses, docks close. */
#ifndef STAGES_H
#define STAGES_H

#include "changes.h"

/* Inputs on the way of a change, and their composite once it is asked for. */
typedef struct {
    double p[INPUT_P_COUNT], c[COMPOSITE_COUNT];
    bool c_is_current;
} Stage;

/* Where a change from `from`, whose composite is c, to p begins: all as before, but for the docks that open. */
void first_stage(Stage *stage, const double from[], const double c[], const double p[]);

/* Lets inputs of some kinds be as in p; docks open, but do not close. Returns whether any was another. */
bool move_stage(Stage *stage, const double p[], unsigned kinds);

/* Makes a stage's composite current, and judges it; kept_momentum.c has it. */
Status weigh_stage(Instance *instance, Stage *stage);

/* Lets inputs of some kinds be as they are now; the rate [rad/s] follows, keeping the momentum; kept_momentum.c has it. */
Status move_keeping_momentum(Instance *instance, Stage *stage, unsigned kinds, double rate[RATE_COUNT]);

#endif
