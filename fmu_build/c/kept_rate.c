/* Masses and poses keep the rate when they change: only docks that close change it, see docking.c. */
#include "kept_in_changes.h"

Status rate_on_the_way(Instance *instance, const double p[], const double c[], double rate[3]) {
    (void)instance, (void)p, (void)c, (void)rate;
    return STATUS_OK;
}

Status changes_forward(Instance *instance, Variation *v) {
    (void)instance, (void)v;
    return STATUS_OK;
}

Status changes_reverse(Instance *instance, Variation *v) {
    (void)instance, (void)v;
    return STATUS_OK;
}
