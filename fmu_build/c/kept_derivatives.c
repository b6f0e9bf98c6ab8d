/* Derivatives of the angular velocity by the inputs over the stages of a change that keep the momentum, as kept_momentum.c
   makes them.

   Needs of the model: keep_momentum and its derivatives, derivatives of composite. */
#include <string.h>

#include "kept_in_changes.h"
#include "model.h"
#include "stages.h"

/* A stage that keeps the momentum, from before it to after it, and the rate before it. */
typedef struct {
    Stage before, after;
    double rate[RATE_COUNT];
    unsigned varied_before, varied_after; /* kinds of inputs that are as now */
} Keeping;

/* The stage in which inputs of a kind change, from docks that have opened; poses change after masses. */
static Status stage_of(Instance *instance, unsigned kind, Keeping *stage) {
    const Dynamics *now = &instance->now;
    Status status = STATUS_OK;
    memcpy(stage->rate, now->kept_rate, sizeof stage->rate);
    first_stage(&stage->before, now->stepped_p, now->kept_c, now->p);
    stage->varied_before = kind == KIND_POSE ? KIND_MASS : 0;
    stage->varied_after = stage->varied_before | kind;
    if (kind == KIND_POSE && MASSES_KEEP_MOMENTUM)
        status = move_keeping_momentum(instance, &stage->before, KIND_MASS, stage->rate);
    else
        move_stage(&stage->before, now->p, stage->varied_before);
    stage->after = stage->before;
    move_stage(&stage->after, now->p, kind);
    if (status == STATUS_OK) status = weigh_stage(instance, &stage->before);
    return status == STATUS_OK ? weigh_stage(instance, &stage->after) : status;
}

static Status stage_forward(Instance *instance, const Variation *v, unsigned kind, double change[RATE_COUNT]) {
    Keeping stage;
    double before[COMPOSITE_COUNT], after[COMPOSITE_COUNT], next[3];
    const Status status = stage_of(instance, kind, &stage);
    if (status != STATUS_OK) return status;
    change_composite(instance, stage.before.p, v, stage.varied_before, before);
    change_composite(instance, stage.after.p, v, stage.varied_after, after);
    const double *const arguments[] = {stage.rate, stage.before.c, stage.after.c, change, before, after};
    memcpy(instance->arg, arguments, sizeof arguments);
    instance->res[0] = next;
    keep_momentum_forward(instance->arg, instance->res, instance->iw, instance->w, 0);
    memcpy(change, next, sizeof next);
    return STATUS_OK;
}

static Status stage_reverse(Instance *instance, double weight[RATE_COUNT], unsigned kind, Variation *v) {
    Keeping stage;
    double on_rate[RATE_COUNT], before[COMPOSITE_COUNT], after[COMPOSITE_COUNT];
    const Status status = stage_of(instance, kind, &stage);
    if (status != STATUS_OK) return status;
    const double *const arguments[] = {stage.rate, stage.before.c, stage.after.c, weight};
    double *const results[] = {on_rate, before, after};
    memcpy(instance->arg, arguments, sizeof arguments);
    memcpy(instance->res, results, sizeof results);
    keep_momentum_reverse(instance->arg, instance->res, instance->iw, instance->w, 0);
    weigh_inputs(instance, stage.before.p, before, stage.varied_before, v);
    weigh_inputs(instance, stage.after.p, after, stage.varied_after, v);
    memcpy(weight, on_rate, 3 * sizeof(double));
    return STATUS_OK;
}

Status rate_on_the_way_forward(Instance *instance, const Variation *v, double change[RATE_COUNT]) {
    const Status status = MASSES_KEEP_MOMENTUM ? stage_forward(instance, v, KIND_MASS, change) : STATUS_OK;
    return POSES_KEEP_MOMENTUM && status == STATUS_OK ? stage_forward(instance, v, KIND_POSE, change) : status;
}

Status rate_on_the_way_reverse(Instance *instance, double weight[RATE_COUNT], Variation *v) {
    const Status status = POSES_KEEP_MOMENTUM ? stage_reverse(instance, weight, KIND_POSE, v) : STATUS_OK;
    return MASSES_KEEP_MOMENTUM && status == STATUS_OK ? stage_reverse(instance, weight, KIND_MASS, v) : status;
}
