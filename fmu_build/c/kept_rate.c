/* Masses and poses keep the rate when they change: only docks that close change it, see docking.c. */
#include "kept_in_changes.h"

Status rate_on_the_way(Instance *instance, const double p[], const double c[], double rate[RATE_COUNT]) {
    (void)instance, (void)p, (void)c, (void)rate;
    return STATUS_OK;
}

Status rate_on_the_way_forward(Instance *instance, const Variation *v, double change[RATE_COUNT]) {
    (void)instance, (void)v, (void)change;
    return STATUS_OK;
}

Status rate_on_the_way_reverse(Instance *instance, double weight[RATE_COUNT], Variation *v) {
    (void)instance, (void)weight, (void)v;
    return STATUS_OK;
}
