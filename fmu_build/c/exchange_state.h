/* What the state of model exchange holds beside the attitude: the angular velocity (rate_state.c) or, where every
   change of inputs keeps it, the angular momentum (momentum_state.c). For changes.c alone. */
#ifndef EXCHANGE_STATE_H
#define EXCHANGE_STATE_H

#include "changes.h"

/* What keeps the momentum beside what keeps the rate: continuous time would need its own rates. */
enum {
    DISCRETE_KINDS =
        STATE_IS_MOMENTUM ? 0 : (MASSES_KEEP_MOMENTUM ? KIND_MASS : 0) | (POSES_KEEP_MOMENTUM ? KIND_POSE : 0)
};

/* Judges a change to p in continuous time. */
Status exchange_check_continuous(Instance *instance, const double p[]);

/* Makes x and the states what they are after a change, which leaves such a rate [rad/s]; p and c are current. */
void exchange_take_rate(Instance *instance, const double rate[RATE_COUNT]);

/* Keeps what the next change begins from, once changes.c has kept the rate. */
void exchange_commit(Instance *instance);

/* Whether a change of inputs, as it is now, changes what the state holds. */
bool exchange_follows(const Instance *instance);

/* Adds to v->x the small change of the state by one of the rate [rad/s]; v->c is that of the composite. Reverse: gives
   the weight on the rate, and adds to that on the composite, that follow from the weight on the state. */
void exchange_forward(Instance *instance, const double change[RATE_COUNT], Variation *v);
void exchange_reverse(Instance *instance, const Variation *v, double weight[RATE_COUNT], double on_composite[]);

#endif
