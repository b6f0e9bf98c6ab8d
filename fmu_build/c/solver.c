#include <float.h>
#include <math.h>
#include <string.h>

#include "instance.h"
#include "model.h"

static const double MOST_SUB_STEPS = 1e7;

static double larger(double a, double b) {
    return a > b ? a : b;
}

/* Rounding that an importer's own times may show, which are sums of its step sizes or multiples of one, counted from
   the start: half an ulp each of a product, a sum and the step added here, none of terms larger than these. */
static double time_slack(const Dynamics *now, double h) {
    const double largest = larger(fabs(now->start_time), fabs(now->values[REFERENCE_TIME]));
    return 4.0 * DBL_EPSILON * larger(largest, h);
}

static Status check_times(Instance *instance, double time, double h) {
    const Dynamics *now = &instance->now;
    if (!(h > 0.0) || !isfinite(h))
        return instance_error(instance, "communicationStepSize = %.10g s: must be finite and > 0", h);
    const double slack = time_slack(now, h);
    if (!(fabs(time - now->values[REFERENCE_TIME]) <= time_slack(now, 0.0)))
        return instance_error(instance, "currentCommunicationPoint = %.17g s: must be the instance's time %.17g s",
                              time, now->values[REFERENCE_TIME]);
    if (!isfinite(time + h))
        return instance_error(instance, "the step from %.17g s by %.10g s ends beyond all finite times", time, h);
    if (now->stop_time_defined && time + h > now->stop_time + larger(slack, 4.0 * DBL_EPSILON * fabs(now->stop_time)))
        return instance_error(instance, "the step from %.17g s by %.10g s passes stopTime = %.17g s", time, h,
                              now->stop_time);
    return STATUS_OK;
}

static bool all_finite(const double *x) {
    bool finite = true;
    for (size_t i = 0; i < STATE_COUNT; i++) finite = finite && isfinite(x[i]);
    return finite;
}

/* Takes one sub-step of at most the model's longest, what remains being shared out evenly: the state goes on, *remaining
   becomes less, and 0 with the last one. */
static Status sub_step(Instance *instance, double h, double taken, double *remaining) {
    double *x = instance_states(instance);
    double square, next[STATE_COUNT];
    instance_set_arguments(instance);
    instance->res[0] = &square;
    fastest_square(instance->arg, instance->res, instance->iw, instance->w, 0);
    double size = *remaining, count = 1.0;
    if (!(size * size * square <= MAX_ANGLE_STEP * MAX_ANGLE_STEP)) {
        const double needed = ceil(*remaining * sqrt(square) / MAX_ANGLE_STEP);
        count = needed > 1.0 || isnan(needed) ? needed : 1.0;
        size = *remaining / count;
    }
    if (!(taken + count <= MOST_SUB_STEPS))
        return instance_refuse(instance,
                               "communicationStepSize = %.10g s needs %.6g sub-steps of max_angle_step = %.10g rad "
                               "with angular_velocity = (%.10g, %.10g, %.10g) rad/s, %.10g s before its end; at most "
                               "%g are taken",
                               h, taken + count, MAX_ANGLE_STEP, x[4], x[5], x[6], *remaining, MOST_SUB_STEPS);
    instance->arg[3] = &size;
    instance->res[0] = next;
    step(instance->arg, instance->res, instance->iw, instance->w, 0);
    if (!all_finite(next))
        return instance_refuse(instance,
                               "a sub-step of %.10g s from angular_velocity = (%.10g, %.10g, %.10g) rad/s leaves the "
                               "range of finite numbers",
                               size, x[4], x[5], x[6]);
    memcpy(x, next, sizeof next);
    instance->outputs_are_current = instance->rates_are_current = false;
    *remaining = count > 1.0 ? *remaining - size : 0.0;
    return STATUS_OK;
}

/* Tells the importer of a sub-step's end at now.values[REFERENCE_TIME]. Returns when the step shall end: at `end`, or
   earlier if the importer wants that and can handle it, but not before now. */
static double listen(Instance *instance, double end) {
    double early = end;
    instance->now.state = INTERMEDIATE;
    instance->within_step = true;
    const bool wanted = instance->sub_step_ended(instance, &early);
    instance->within_step = false;
    if (instance->now.state == INTERMEDIATE) instance->now.state = STEPPING;
    if (!wanted || !instance->early_return_allowed || !(early < end)) return end;
    return larger(early, instance->now.values[REFERENCE_TIME]);
}

Status solver_step(Instance *instance, double time, double h, bool *ended_early) {
    Dynamics *now = &instance->now;
    *ended_early = false;
    Status status = check_times(instance, time, h);
    if (status == STATUS_OK) status = composite_refresh(instance);
    if (status != STATUS_OK) return status;
    double start[STATE_COUNT], end = time + h, remaining = h, taken = 0.0;
    const double start_time = now->values[REFERENCE_TIME];
    memcpy(start, instance_states(instance), sizeof start);
    const Call *call = instance->call;
    while (remaining > 0.0) {
        instance->call = call;
        status = sub_step(instance, h, taken, &remaining);
        if (status != STATUS_OK) {
            instance->outputs_are_current = instance->rates_are_current = false;
            memcpy(instance_states(instance), start, sizeof start);
            now->values[REFERENCE_TIME] = start_time;
            return status;
        }
        taken += 1.0;
        now->values[REFERENCE_TIME] = remaining > 0.0 ? end - remaining : end;
        if (!instance->sub_step_ended) continue;
        const double wanted = listen(instance, end);
        if (now->state == TERMINATED) return STATUS_ERROR;
        if (wanted < end) {
            *ended_early = true;
            end = wanted;
            remaining = end - now->values[REFERENCE_TIME];
        }
    }
    return STATUS_OK;
}
