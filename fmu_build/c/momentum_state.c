/* The state of model exchange is the angular momentum: every change of inputs keeps it, so that it is smooth where the
   rate is not. Attitude and angular velocity, x, are then a mirror: they follow from the states in model exchange, and
   the states from them in co-simulation and before the start.

   Owns x, kept_momentum and mirror_is_current. Needs of the model: momentum_of, rate_of_momentum. */
#include <string.h>

#include "docks.h"
#include "exchange_state.h"
#include "model.h"

/* The momenta of wheels are the same in x and in the states. */
static void copy_wheels(double to[], const double from[]) {
    memcpy(to + 7, from + 7, (STATE_COUNT - 7) * sizeof(double));
}

static bool states_lead(const Instance *instance) {
    return instance->now.model_exchange && !(changes_state(instance) & BEFORE_START);
}

static void momentum_from_rate(Instance *instance, const double rate[RATE_COUNT], double momentum[3]) {
    instance->arg[0] = rate;
    instance->arg[1] = instance->now.c;
    instance->res[0] = momentum;
    momentum_of(instance->arg, instance->res, instance->iw, instance->w, 0);
}

void changes_mirror(Instance *instance) {
    if (instance->mirror_is_current) return;
    double *x = instance_x(instance), *states = instance_states(instance);
    if (states_lead(instance)) {
        memcpy(x, states, 4 * sizeof(double));
        copy_wheels(x, states);
        instance->arg[0] = states + 4;
        instance->arg[1] = instance->now.c;
        instance->res[0] = x + 4;
        rate_of_momentum(instance->arg, instance->res, instance->iw, instance->w, 0);
    } else {
        memcpy(states, x, 4 * sizeof(double));
        copy_wheels(states, x);
        momentum_from_rate(instance, x + 4, states + 4);
    }
    instance->mirror_is_current = true;
}

/* A dock that opened or closed has changed the momentum; everything else keeps it. */
static bool docks_moved(const Instance *instance) {
    bool moved = false;
    for (size_t i = 0; i < INPUT_P_COUNT && DOCK_COUNT > 0; i++)
        moved = moved || (INPUT_KINDS[i] == KIND_DOCKED && instance->now.p[i] != instance->now.stepped_p[i]);
    return moved;
}

Status exchange_check_continuous(Instance *instance, const double p[]) {
    (void)instance, (void)p;
    return STATUS_OK;
}

void exchange_take_rate(Instance *instance, const double rate[RATE_COUNT]) {
    if (!states_lead(instance)) {
        memcpy(instance_x(instance) + 4, rate, 3 * sizeof(double));
        return;
    }
    double *momentum = instance_states(instance) + 4;
    memcpy(momentum, instance->now.kept_momentum, sizeof instance->now.kept_momentum);
    if (docks_moved(instance)) momentum_from_rate(instance, rate, momentum);
}

void exchange_commit(Instance *instance) {
    memcpy(instance->now.kept_momentum, instance_states(instance) + 4, sizeof instance->now.kept_momentum);
}

bool changes_moved(const Instance *instance) {
    return memcmp(instance->now.kept_momentum, &instance->now.values[REFERENCE_STATES + 4], 3 * sizeof(double)) != 0;
}

static void momentum_change(Instance *instance, const double change[RATE_COUNT], const double dc[],
                            double momentum[3]) {
    const double *const arguments[] = {instance_x(instance) + 4, instance->now.c, change, dc};
    memcpy(instance->arg, arguments, sizeof arguments);
    instance->res[0] = momentum;
    momentum_of_forward(instance->arg, instance->res, instance->iw, instance->w, 0);
}

static void momentum_weights(Instance *instance, const double weight[3], double on_rate[RATE_COUNT],
                             double on_composite[]) {
    const double *const arguments[] = {instance_x(instance) + 4, instance->now.c, weight};
    memcpy(instance->arg, arguments, sizeof arguments);
    instance->res[0] = on_rate;
    instance->res[1] = on_composite;
    momentum_of_reverse(instance->arg, instance->res, instance->iw, instance->w, 0);
}

void changes_start_forward(Instance *instance, Variation *v) {
    double momentum[3];
    momentum_change(instance, v->x + 4, v->c, momentum);
    memcpy(v->x + 4, momentum, sizeof momentum);
}

void changes_start_reverse(Instance *instance, Variation *v) {
    double rate[RATE_COUNT], c[COMPOSITE_COUNT];
    momentum_weights(instance, v->x + 4, rate, c);
    memcpy(v->x + 4, rate, 3 * sizeof(double));
    for (size_t i = 3; i < RATE_COUNT; i++) v->x[4 + i] += rate[i];
    for (size_t i = 0; i < COMPOSITE_COUNT; i++) v->c[i] += c[i];
}

bool exchange_follows(const Instance *instance) {
    return docks_moved(instance);
}

void exchange_forward(Instance *instance, const double change[RATE_COUNT], Variation *v) {
    double momentum[3];
    momentum_change(instance, change, v->c, momentum);
    for (size_t i = 0; i < 3; i++) v->x[4 + i] += momentum[i];
}

void exchange_reverse(Instance *instance, const Variation *v, double weight[RATE_COUNT], double on_composite[]) {
    double c[COMPOSITE_COUNT];
    momentum_weights(instance, v->x + 4, weight, c);
    for (size_t i = 0; i < COMPOSITE_COUNT; i++) on_composite[i] += c[i];
}

#if DOCK_COUNT == 0

/* The momentum stays as it is, and the rate follows from it and the inputs by itself. */
Status changes_forward(Instance *instance, Variation *v) {
    (void)instance, (void)v;
    return STATUS_OK;
}

Status changes_reverse(Instance *instance, Variation *v) {
    (void)instance, (void)v;
    return STATUS_OK;
}

#endif
