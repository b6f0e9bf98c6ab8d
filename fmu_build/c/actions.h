/* What is judged of inputs that act, wherever the motion follows from them: motors of wheels, and flows. */
#ifndef ACTIONS_H
#define ACTIONS_H

#include "flows.h"
#include "motors.h"

/* Refuses inputs that act with values that cannot be used; the composite must be current. */
static inline Status actions_check(Instance *instance) {
    const Status status = motors_check(instance);
    return status == STATUS_OK ? flows_check(instance) : status;
}

#endif
