/* Masses or poses keep the angular momentum when they change: the rate after a change, stage by stage, from what was
   committed: docks open, masses and moments change, then poses.

   Needs of the model: keep_momentum. */
#include "kept_in_changes.h"

#include <string.h>

#include "model.h"
#include "stages.h"

/* Computes and judges the composite c of inputs p on the way of a change. */
static Status composite_between(Instance *instance, const double p[], double c[]) {
    composite_compute(instance, p, c);
    if (composite_is_usable(c)) return STATUS_OK;
    const double *J = &c[COMPOSITE_INERTIA];
    return instance_refuse(instance,
                           "between the changes of docks, masses and poses mass = %.10g kg, inertia (xx, yy, zz, xy, "
                           "xz, yz) = (%.10g, %.10g, %.10g, %.10g, %.10g, %.10g) kg.m2: must be finite and positive "
                           "definite for the angular momentum to be kept; make them one after the other",
                           c[COMPOSITE_MASS], J[0], J[1], J[2], J[3], J[4], J[5]);
}

Status weigh_stage(Instance *instance, Stage *stage) {
    const Status status = stage->c_is_current ? STATUS_OK : composite_between(instance, stage->p, stage->c);
    stage->c_is_current = status == STATUS_OK;
    return status;
}

/* Goes on from a stage to one where inputs of some kinds are as in p, whose composite is c, keeping the momentum. */
static Status keep(Instance *instance, Stage *stage, const double p[], const double c[], unsigned kinds,
                   double rate[RATE_COUNT]) {
    if (memcmp(stage->p, p, sizeof stage->p) == 0) return STATUS_OK;
    Stage next = *stage;
    double changed[3];
    if (!move_stage(&next, p, kinds)) return STATUS_OK;
    if (memcmp(next.p, p, sizeof next.p) == 0) {
        memcpy(next.c, c, sizeof next.c);
        next.c_is_current = true;
    }
    Status status = weigh_stage(instance, stage);
    if (status == STATUS_OK) status = weigh_stage(instance, &next);
    if (status != STATUS_OK) return status;
    instance->arg[0] = rate;
    instance->arg[1] = stage->c;
    instance->arg[2] = next.c;
    instance->res[0] = changed;
    keep_momentum(instance->arg, instance->res, instance->iw, instance->w, 0);
    memcpy(rate, changed, sizeof changed);
    *stage = next;
    return STATUS_OK;
}

Status move_keeping_momentum(Instance *instance, Stage *stage, unsigned kinds, double rate[RATE_COUNT]) {
    return keep(instance, stage, instance->now.p, instance->now.c, kinds, rate);
}

Status rate_on_the_way(Instance *instance, const double p[], const double c[], double rate[RATE_COUNT]) {
    Stage stage;
    Status status = STATUS_OK;
    first_stage(&stage, instance->now.stepped_p, instance->now.kept_c, p);
    if (MASSES_KEEP_MOMENTUM)
        status = keep(instance, &stage, p, c, KIND_MASS, rate);
    else
        move_stage(&stage, p, KIND_MASS);
    if (POSES_KEEP_MOMENTUM && status == STATUS_OK) status = keep(instance, &stage, p, c, KIND_POSE, rate);
    return status;
}
