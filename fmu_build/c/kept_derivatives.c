/* Derivatives of the angular velocity by the inputs, where some kinds of change keep the momentum and others the rate:
   in co-simulation the rate follows from the inputs as kept_momentum.c makes it.

   Needs of the model: derivatives of composite and keep_momentum. */
#include <string.h>

#include "kept_in_changes.h"
#include "model.h"
#include "stages.h"

/* Whether the angular velocity follows from inputs: in co-simulation, but not within a step. */
static bool rate_follows(const Instance *instance) {
    return !instance->now.model_exchange && !(changes_state(instance) & (BEFORE_START | INTERMEDIATE));
}

/* The two stages between which momentum was kept last, or would be: before it and after it. */
typedef struct {
    Stage before, after;
    unsigned varied_before, varied_after; /* kinds of inputs that are as now */
} Stages;

/* Of kinds that keep the rate, those before the one that keeps momentum belong to both stages. */
static Status stages_of(Instance *instance, Stages *stages) {
    changes_begin(instance);
    const Dynamics *now = &instance->now;
    stages->varied_before = MASSES_KEEP_MOMENTUM ? 0 : KIND_MASS;
    stages->varied_after = MASSES_KEEP_MOMENTUM ? KIND_MASS : KIND_MASS | KIND_POSE;
    first_stage(&stages->before, now->stepped_p, now->kept_c, now->p);
    move_stage(&stages->before, now->p, stages->varied_before);
    stages->after = stages->before;
    move_stage(&stages->after, now->p, stages->varied_after);
    const Status status = weigh_stage(instance, &stages->before);
    return status == STATUS_OK ? weigh_stage(instance, &stages->after) : status;
}

/* Changes of a composite, dc, by those of the inputs of some kinds. */
static void composite_change(Instance *instance, const double p[], const Variation *v, unsigned kinds, double dc[]) {
    double dp[INPUT_P_COUNT];
    for (size_t i = 0; i < INPUT_P_COUNT; i++) dp[i] = INPUT_KINDS[i] & kinds ? v->inputs[i] : 0.0;
    instance->arg[0] = p;
    instance->arg[1] = dp;
    instance->res[0] = dc;
    composite_forward(instance->arg, instance->res, instance->iw, instance->w, 0);
}

Status changes_forward(Instance *instance, Variation *v) {
    if (!rate_follows(instance)) return STATUS_OK;
    Stages stages;
    double before[COMPOSITE_COUNT], after[COMPOSITE_COUNT], change[3];
    static const double none[3] = {0.0, 0.0, 0.0};
    const Status status = stages_of(instance, &stages);
    if (status != STATUS_OK) return status;
    composite_change(instance, stages.before.p, v, stages.varied_before, before);
    composite_change(instance, stages.after.p, v, stages.varied_after, after);
    const double *const arguments[] = {instance->now.kept_rate, stages.before.c, stages.after.c, none, before, after};
    memcpy(instance->arg, arguments, sizeof arguments);
    instance->res[0] = change;
    keep_momentum_forward(instance->arg, instance->res, instance->iw, instance->w, 0);
    for (size_t i = 0; i < 3; i++) v->x[4 + i] += change[i];
    return STATUS_OK;
}

/* Adds weights on inputs of some kinds that follow from those on a composite. */
static void composite_weights(Instance *instance, const double p[], const double wc[], unsigned kinds, Variation *v) {
    double wp[INPUT_P_COUNT];
    instance->arg[0] = p;
    instance->arg[1] = wc;
    instance->res[0] = wp;
    composite_reverse(instance->arg, instance->res, instance->iw, instance->w, 0);
    for (size_t i = 0; i < INPUT_P_COUNT; i++)
        if (INPUT_KINDS[i] & kinds) v->inputs[i] += wp[i];
}

Status changes_reverse(Instance *instance, Variation *v) {
    if (!rate_follows(instance)) return STATUS_OK;
    Stages stages;
    double on_rate[3], before[COMPOSITE_COUNT], after[COMPOSITE_COUNT];
    const Status status = stages_of(instance, &stages);
    if (status != STATUS_OK) return status;
    const double *const arguments[] = {instance->now.kept_rate, stages.before.c, stages.after.c, v->x + 4};
    double *const results[] = {on_rate, before, after};
    memcpy(instance->arg, arguments, sizeof arguments);
    memcpy(instance->res, results, sizeof results);
    keep_momentum_reverse(instance->arg, instance->res, instance->iw, instance->w, 0);
    composite_weights(instance, stages.before.p, before, stages.varied_before, v);
    composite_weights(instance, stages.after.p, after, stages.varied_after, v);
    return STATUS_OK;
}
