#include <float.h>
#include <math.h>
#include <string.h>

#include "instance.h"
#include "model.h"

static const double MOST_SUB_STEPS = 1e7;

/* Rounding that an importer's own sum of its step sizes may show. */
static double time_slack(double time, double h) {
    return 4.0 * DBL_EPSILON * fmax(fabs(time), h);
}

static Status check_times(Instance *instance, double time, double h) {
    if (!(h > 0.0) || !isfinite(h))
        return instance_error(instance, "communicationStepSize = %.10g s: must be finite and > 0", h);
    if (!(fabs(time - instance->time) <= time_slack(instance->time, h)))
        return instance_error(instance, "currentCommunicationPoint = %.17g s: must be the instance's time %.17g s",
                              time, instance->time);
    if (instance->stop_time_defined && time + h > instance->stop_time + time_slack(instance->stop_time, h))
        return instance_error(instance, "the step from %.17g s by %.10g s passes stopTime = %.17g s", time, h,
                              instance->stop_time);
    return STATUS_OK;
}

static bool all_finite(const double *x) {
    bool finite = true;
    for (size_t i = 0; i < STATE_COUNT; i++) finite = finite && isfinite(x[i]);
    return finite;
}

/* Takes sub-steps of at most the model's longest step, what remains being shared out evenly. */
static Status integrate(Instance *instance, double h, double x[STATE_COUNT]) {
    double remaining = h, taken = 0.0, count = 2.0;
    while (count > 1.0) {
        double h_max, next[STATE_COUNT];
        instance->arg[0] = x;
        instance->arg[1] = &instance->values[REFERENCE_TORQUE];
        instance->arg[2] = instance->c;
        instance->res[0] = &h_max;
        longest_step(instance->arg, instance->res, instance->iw, instance->w, 0);
        count = fmax(1.0, ceil(remaining / h_max));
        if (!(taken + count <= MOST_SUB_STEPS))
            return instance_refuse(instance,
                                   "communicationStepSize = %.10g s needs %.6g sub-steps of max_angle_step = %.10g rad "
                                   "with angular_velocity = (%.10g, %.10g, %.10g) rad/s, %.10g s before its end; at "
                                   "most %g are taken",
                                   h, taken + count, MAX_ANGLE_STEP, x[4], x[5], x[6], remaining, MOST_SUB_STEPS);
        const double sub_step = remaining / count;
        instance->arg[3] = &sub_step;
        instance->res[0] = next;
        step(instance->arg, instance->res, instance->iw, instance->w, 0);
        if (!all_finite(next))
            return instance_refuse(instance,
                                   "a sub-step of %.10g s from angular_velocity = (%.10g, %.10g, %.10g) rad/s leaves "
                                   "the range of finite numbers",
                                   sub_step, x[4], x[5], x[6]);
        memcpy(x, next, sizeof next);
        remaining -= sub_step;
        taken += 1.0;
    }
    return STATUS_OK;
}

Status solver_step(Instance *instance, double time, double h) {
    Status status = check_times(instance, time, h);
    if (status == STATUS_OK) status = composite_refresh(instance);
    if (status != STATUS_OK) return status;
    double x[STATE_COUNT];
    memcpy(x, instance->x, sizeof x);
    status = integrate(instance, h, x);
    if (status != STATUS_OK) return status;
    memcpy(instance->x, x, sizeof x);
    instance->time = time + h;
    instance->outputs_are_current = false;
    return STATUS_OK;
}
