/* What happens to the angular velocity when inputs change: see supervessel/rotation/changes.py.

   The FMU has changes.c where a change of inputs can change the rate, else no_changes.c. With changes.c goes the file
   of what the state of model exchange is (momentum_state.c, rate_state.c), and that of what masses and poses keep
   (kept_momentum.c, kept_rate.c). Where states follow from inputs otherwise than by keeping the momentum alone there are
   the derivatives of that too: change_derivatives.c, kept_derivatives.c. */
#ifndef CHANGES_H
#define CHANGES_H

#include "actions.h"
#include "composite.h"
#include "instance.h"

/* What kind of change an input of the composite makes, as bits. */
enum { KIND_MASS = 1, KIND_POSE = 2, KIND_DOCKED = 4 };

/* By place in p; generated where there are changes. */
extern const unsigned char INPUT_KINDS[];

/* The State whose rules hold for what is read: after the end those that held before. */
static inline unsigned changes_state(const Instance *instance) {
    return instance->now.state == TERMINATED ? instance->now.ended_in : instance->now.state;
}

/* The inputs and the rate at the end of initialisation are those that the first change begins from. */
void changes_start(Instance *instance);

/* Makes the rate follow from a change to p, whose composite is c; they become current if it can. */
Status changes_apply(Instance *instance, const double p[], const double c[]);

/* In co-simulation, unless inputs have changed since the last step: the rate and the composite are those that the next
   change begins from. A step need not tell. */
void changes_begin(Instance *instance);

/* The inputs and the rate as they are now are those that the next change begins from. */
void changes_commit(Instance *instance);

/* Whether what the state of model exchange holds has changed since the last commit. */
bool changes_moved(const Instance *instance);

/* Where the angular momentum is a state of model exchange, x and the states are two copies of the same motion. Makes x
   follow from the states in model exchange, and the states from x in co-simulation and before the start. */
void changes_mirror(Instance *instance);

/* Adds to v->x what small changes of the inputs do to the state by themselves where it follows from them: in event mode,
   and in co-simulation between steps. v->c is the change of the composite. Reverse: adds to the weights on the inputs
   those that follow from the weights on v->x. */
Status changes_forward(Instance *instance, Variation *v);
Status changes_reverse(Instance *instance, Variation *v);

/* At the start, where the angular momentum is a state: turns the change of the angular velocity in v->x into that of
   the momentum; reverse: turns weights on the momentum into weights on the angular velocity. */
void changes_start_forward(Instance *instance, Variation *v);
void changes_start_reverse(Instance *instance, Variation *v);

/* In continuous time: has continuous inputs as they were set, whether or not anything that follows from them has been
   read. Discrete ones that were set there wait for the event. */
Status changes_settle(Instance *instance);

/* Goes on to EVENT; changes of inputs begin from the states and the continuous inputs as they are. */
static inline Status changes_enter_event(Instance *instance) {
    if (instance->now.state == CONTINUOUS) {
        const Status status = changes_settle(instance);
        if (status != STATUS_OK) return status;
        changes_commit(instance);
    }
    instance->now.state = EVENT;
    return STATUS_OK;
}

/* Ends an iteration of event mode: judges what was set, and whether that changed the states. */
static inline Status changes_end_event(Instance *instance, bool *states_changed) {
    Status status = composite_refresh(instance);
    if (status == STATUS_OK) status = actions_check(instance);
    *states_changed = false;
    if (status != STATUS_OK) return status;
    changes_begin(instance);
    *states_changed = changes_moved(instance);
    changes_commit(instance);
    return status;
}

/* Goes on to CONTINUOUS, where what was set in event mode is not to be judged by the rules of continuous time. */
static inline Status changes_enter_continuous(Instance *instance) {
    bool states_changed;
    const Status status = CHANGES ? changes_end_event(instance, &states_changed) : STATUS_OK;
    if (status == STATUS_OK) instance->now.state = CONTINUOUS;
    return status;
}

#endif
