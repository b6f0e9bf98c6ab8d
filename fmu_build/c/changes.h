/* What happens to the angular velocity when inputs change: see supervessel/changes.py. */
#ifndef CHANGES_H
#define CHANGES_H

#include "instance.h"

/* What kind of change an input of the composite makes, as bits. */
enum { KIND_MASS = 1, KIND_POSE = 2, KIND_DOCKED = 4 };

#if CHANGES
/* By place in p. */
extern const unsigned char INPUT_KINDS[INPUT_P_COUNT];
#endif

#if DOCK_COUNT
typedef struct {
    const char *ports[2], *vessels[2]; /* names */
    int vessel[2];                     /* numbers */
    int flag;                          /* place in p of the input that closes it; -1: it is always closed */
    int motion;                        /* place among the inputs of motion at contact, or -1 */
} Dock;

extern const Dock DOCKS[DOCK_COUNT];

/* Judges which docks are closed; p holds their flags. */
Status changes_check_docks(Instance *instance, const double p[]);
#endif

#if CHANGES
/* The State whose rules hold for what is read: after the end those that held before. */
static inline unsigned changes_state(const Instance *instance) {
    return instance->now.state == TERMINATED ? instance->now.ended_in : instance->now.state;
}
#endif

/* Makes the rate follow from a change to p, whose composite is c; they become current if it can. */
Status changes_apply(Instance *instance, const double p[], const double c[]);

/* In co-simulation, unless inputs have changed since the last step: the rate and the composite are those that the next
   change begins from. A step need not tell. */
void changes_begin(Instance *instance);

/* The inputs and the rate as they are now are those that the next change begins from. */
void changes_commit(Instance *instance);

/* Whether what the state of model exchange holds has changed since the last commit. */
bool changes_moved(const Instance *instance);

/* Goes on to EVENT; changes of inputs begin from the states as they are. */
static inline void changes_enter_event(Instance *instance) {
#if CHANGES
    if (instance->now.state == CONTINUOUS) changes_commit(instance);
#endif
    instance->now.state = EVENT;
}

/* Ends an iteration of event mode: judges what was set, and whether that changed the states. */
static inline Status changes_end_event(Instance *instance, bool *states_changed) {
    const Status status = composite_refresh(instance);
    *states_changed = false;
#if CHANGES
    if (status == STATUS_OK) {
        changes_begin(instance);
        *states_changed = changes_moved(instance);
        changes_commit(instance);
    }
#endif
    return status;
}

/* Goes on to CONTINUOUS, where what was set in event mode is not to be judged by the rules of continuous time. */
static inline Status changes_enter_continuous(Instance *instance) {
    Status status = STATUS_OK;
#if CHANGES
    bool states_changed;
    status = changes_end_event(instance, &states_changed);
#endif
    if (status == STATUS_OK) instance->now.state = CONTINUOUS;
    return status;
}

/* Where the state of model exchange is the angular momentum: makes x follow from the states in model exchange, the
   states from x elsewhere, unless they do. */
#if STATE_IS_MOMENTUM
void changes_mirror(Instance *instance);
#else
static inline void changes_mirror(Instance *instance) {
    (void)instance;
}
#endif

/* What small changes of the inputs make of the angular velocity, added to v->x: by what the last change kept. Reverse:
   weights on v->x to weights on the inputs. */
Status changes_forward(Instance *instance, Variation *v);
Status changes_reverse(Instance *instance, Variation *v);

/* The state's momentum at the start: a change of v->x, of rate, to one of momentum, and weights back. */
void changes_start_forward(Instance *instance, Variation *v);
void changes_start_reverse(Instance *instance, Variation *v);

#endif
