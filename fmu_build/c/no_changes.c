/* No change of inputs changes the rate: of what changes.h declares nothing is left to do but to keep p and c. The motion
   that the bound of the error is about may change all the same, event by event. */
#include <string.h>

#include "changes.h"
#include "error_bound.h"

void changes_start(Instance *instance) {
    memcpy(instance->now.stepped_p, instance->now.p, sizeof instance->now.p);
}

Status changes_apply(Instance *instance, const double p[], const double c[]) {
    memcpy(instance->now.p, p, INPUT_P_COUNT * sizeof(double));
    memcpy(instance->now.c, c, sizeof instance->now.c);
    return STATUS_OK;
}

void changes_begin(Instance *instance) {
    (void)instance;
}

Status changes_settle(Instance *instance) {
    (void)instance;
    return STATUS_OK;
}

void changes_commit(Instance *instance) {
    bound_over_change(instance);
    bound_remember(instance);
}

bool changes_moved(const Instance *instance) {
    (void)instance;
    return false;
}

void changes_mirror(Instance *instance) {
    (void)instance;
}

Status changes_forward(Instance *instance, Variation *v) {
    (void)instance, (void)v;
    return STATUS_OK;
}

Status changes_reverse(Instance *instance, Variation *v) {
    (void)instance, (void)v;
    return STATUS_OK;
}

void changes_start_forward(Instance *instance, Variation *v) {
    (void)instance, (void)v;
}

void changes_start_reverse(Instance *instance, Variation *v) {
    (void)instance, (void)v;
}
