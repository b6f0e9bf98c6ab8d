/* Flows of propellant out of vessels: none may be negative (flows.c). */
#ifndef FLOWS_H
#define FLOWS_H

#include "instance.h"

#ifdef FLOW_COUNT

/* Refuses a flow below 0. */
Status flows_check(Instance *instance);

#else

static inline Status flows_check(Instance *instance) {
    (void)instance;
    return STATUS_OK;
}

#endif

#endif
