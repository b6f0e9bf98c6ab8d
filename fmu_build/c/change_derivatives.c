/* Derivatives of what the angular velocity is after a change of inputs, through all of its stages: docks open, masses
   change, then poses (kept_derivatives.c, kept_rate.c), docks close (docking.c). At each of them a small change of the
   inputs is carried on to one of the rate; weights on the rate are carried back. In event mode, and in co-simulation
   between steps, the states are what the inputs make of those that were committed.

   Needs of the model: derivatives of composite. */
#include <string.h>

#include "docks.h"
#include "exchange_state.h"
#include "kept_in_changes.h"
#include "model.h"

enum { ALL_KINDS = KIND_MASS | KIND_POSE | KIND_DOCKED };

void change_composite(Instance *instance, const double p[], const Variation *v, unsigned kinds, double dc[]) {
    double dp[INPUT_P_COUNT];
    for (size_t i = 0; i < INPUT_P_COUNT; i++) dp[i] = INPUT_KINDS[i] & kinds ? v->inputs[i] : 0.0;
    instance->arg[0] = p;
    instance->arg[1] = dp;
    instance->res[0] = dc;
    composite_forward(instance->arg, instance->res, instance->iw, instance->w, 0);
}

void weigh_inputs(Instance *instance, const double p[], const double wc[], unsigned kinds, Variation *v) {
    double wp[INPUT_P_COUNT];
    instance->arg[0] = p;
    instance->arg[1] = wc;
    instance->res[0] = wp;
    composite_reverse(instance->arg, instance->res, instance->iw, instance->w, 0);
    for (size_t i = 0; i < INPUT_P_COUNT; i++)
        if (INPUT_KINDS[i] & kinds) v->inputs[i] += wp[i];
}

/* Whether the states follow from inputs: not before the start, within a step, or in continuous time. */
static bool states_follow(const Instance *instance) {
    const unsigned held = BEFORE_START | INTERMEDIATE | CONTINUOUS;
    return !(changes_state(instance) & held) && exchange_follows(instance);
}

/* The rate before docks close. */
static Status rate_before_docking(Instance *instance, double rate[RATE_COUNT]) {
    const Dynamics *now = &instance->now;
    changes_begin(instance);
    memcpy(rate, now->kept_rate, sizeof now->kept_rate);
    return rate_on_the_way(instance, now->p, now->c, rate);
}

Status changes_forward(Instance *instance, Variation *v) {
    if (!states_follow(instance)) return STATUS_OK;
    double rate[RATE_COUNT], change[RATE_COUNT] = {0.0};
    Status status = rate_before_docking(instance, rate);
    if (status == STATUS_OK) status = rate_on_the_way_forward(instance, v, change);
    if (status != STATUS_OK) return status;
    docks_join_forward(instance, v, rate, change);
    exchange_forward(instance, change, v);
    return STATUS_OK;
}

Status changes_reverse(Instance *instance, Variation *v) {
    if (!states_follow(instance)) return STATUS_OK;
    double rate[RATE_COUNT], weight[RATE_COUNT], on_composite[COMPOSITE_COUNT] = {0.0};
    const Status status = rate_before_docking(instance, rate);
    if (status != STATUS_OK) return status;
    exchange_reverse(instance, v, weight, on_composite);
    docks_join_reverse(instance, rate, weight, on_composite, v);
    if (STATE_IS_MOMENTUM || DOCK_COUNT > 0) weigh_inputs(instance, instance->now.p, on_composite, ALL_KINDS, v);
    return rate_on_the_way_reverse(instance, weight, v);
}
