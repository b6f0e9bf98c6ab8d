/* What an instant of change hands over to whoever integrates the orbit: the jumps of the barycentre and of its velocity,
   and the outputs of vessels that docks let go, at that instant; see supervessel/rotation/hand_over.py. All of it is added
   to what the model gives for these outputs, where it is 0. All changes of inputs at one time are one instant.

   Of Dynamics it owns handed. The FMU has hand_over.c where outputs show any of this. */
#ifndef HAND_OVER_H
#define HAND_OVER_H

#include "instance.h"

#if HANDED_COUNT

/* By place in what is handed over, place among the outputs, or -1; generated. */
extern const int HANDED_OUTPUTS[HANDED_COUNT];

/* No change has been set since the last step or event: what is handed over is that of the last one before. */
void hand_over_hold(Instance *instance);

/* A change of inputs from those committed to p, whose composite is c, with such a rate as docks close [rad/s]. */
Status hand_over_change(Instance *instance, const double p[], const double c[], const double rate[RATE_COUNT]);

/* Adds what is handed over to the outputs, which follow from state, inputs and composite as they are. */
void hand_over_show(Instance *instance);

/* Adds to v->y what small changes of the inputs do to what is handed over; v->c is that of the composite. Reverse: adds to
   the weights on the inputs those that follow from v->y. */
Status hand_over_forward(Instance *instance, Variation *v);
Status hand_over_reverse(Instance *instance, Variation *v);

#else

static inline void hand_over_hold(Instance *instance) {
    (void)instance;
}
static inline Status hand_over_change(Instance *instance, const double p[], const double c[],
                                      const double rate[RATE_COUNT]) {
    (void)instance, (void)p, (void)c, (void)rate;
    return STATUS_OK;
}
static inline void hand_over_show(Instance *instance) {
    (void)instance;
}
static inline Status hand_over_forward(Instance *instance, Variation *v) {
    (void)instance, (void)v;
    return STATUS_OK;
}
static inline Status hand_over_reverse(Instance *instance, Variation *v) {
    (void)instance, (void)v;
    return STATUS_OK;
}

#endif

#endif
