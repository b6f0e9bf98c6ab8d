/* The state of model exchange is the angular velocity: some changes of inputs do not keep the momentum. */
#include <string.h>

#include "exchange_state.h"
#include "variables.h"

void changes_mirror(Instance *instance) {
    (void)instance;
}

/* Where masses keep the rate and poses the momentum, or the other way round, a change in continuous time would need
   the inputs' own rates, which FMI does not give. */
Status exchange_check_continuous(Instance *instance, const double p[]) {
    for (size_t i = 0; i < INPUT_P_COUNT; i++) {
        if (!(INPUT_KINDS[i] & DISCRETE_KINDS) || p[i] == instance->now.stepped_p[i]) continue;
        const Variable *variable = &VARIABLES[REFERENCE_P + i];
        return instance_refuse(instance,
                               "%s = %.10g%s%s: changed from %.10g in continuous-time mode, but %s keep the angular "
                               "momentum and %s the angular velocity, so that its rate would have to be known; it is "
                               "discrete: change it in event mode",
                               variable->name, p[i], variable->unit[0] ? " " : "", variable->unit,
                               instance->now.stepped_p[i], POSES_KEEP_MOMENTUM ? "poses" : "masses",
                               POSES_KEEP_MOMENTUM ? "masses" : "poses");
    }
    return STATUS_OK;
}

void exchange_take_rate(Instance *instance, const double rate[RATE_COUNT]) {
    memcpy(instance_x(instance) + 4, rate, 3 * sizeof(double));
}

void exchange_commit(Instance *instance) {
    (void)instance;
}

bool changes_moved(const Instance *instance) {
    return memcmp(instance->now.kept_rate, &instance->now.values[REFERENCE_STATES + 4], 3 * sizeof(double)) != 0;
}

bool exchange_follows(const Instance *instance) {
    (void)instance;
    return true;
}

void exchange_forward(Instance *instance, const double change[RATE_COUNT], Variation *v) {
    (void)instance;
    for (size_t i = 0; i < 3; i++) v->x[4 + i] += change[i];
}

void exchange_reverse(Instance *instance, const Variation *v, double weight[RATE_COUNT], double on_composite[]) {
    (void)instance, (void)on_composite;
    memcpy(weight, v->x + 4, RATE_COUNT * sizeof(double));
}

void changes_start_forward(Instance *instance, Variation *v) {
    (void)instance, (void)v;
}

void changes_start_reverse(Instance *instance, Variation *v) {
    (void)instance, (void)v;
}
