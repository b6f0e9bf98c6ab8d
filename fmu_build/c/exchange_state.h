/* What the state of model exchange holds beside the attitude: the angular velocity (rate_state.c) or, where every
   change of inputs keeps it, the angular momentum (momentum_state.c). For changes.c alone. */
#ifndef EXCHANGE_STATE_H
#define EXCHANGE_STATE_H

#include "changes.h"

/* Judges a change to p in continuous time. */
Status exchange_check_continuous(Instance *instance, const double p[]);

/* Makes x and the states what they are after a change, which leaves such a rate [rad/s]; p and c are current. */
void exchange_take_rate(Instance *instance, const double rate[3]);

/* Keeps what the next change begins from, once changes.c has kept the rate. */
void exchange_commit(Instance *instance);

#endif
