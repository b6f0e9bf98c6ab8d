/* Communication steps of co-simulation: judges the times that the importer gives, takes one sub-step after the other
   until the step ends, tells the importer of each, and puts everything back where a sub-step is refused.

   Owns time, the estimate of the error and stepped_p of a step; what a sub-step does to attitude and angular velocity is the
   method's, see solver.h. Needs a composite that composite.c has judged. */
#include "solver.h"

#include <string.h>

#include "actions.h"
#include "composite.h"
#include "error_bound.h"
#include "field.h"
#include "model.h"
#include "variables.h"

/* Of the span from startTime to stopTime. */
static const double PAST_STOP = 1e-9;

/* Rounding that an importer's own times may show, which are sums of its step sizes or multiples of one, counted from
   the start: half an ulp each of a product, a sum and the step added here, none of terms larger than these. */
static double time_slack(const Dynamics *now, double h) {
    const double largest = larger(fabs(now->start_time), fabs(now->values[REFERENCE_TIME]));
    return 4.0 * DBL_EPSILON * larger(largest, h);
}

/* By how much the last step of a flight may pass stopTime [s]: a sum of step sizes is off by a rounding at each of them,
   after a million steps by up to 1e-10 of the span. */
static double stop_slack(const Dynamics *now, double h) {
    const double rounding = larger(time_slack(now, h), 4.0 * DBL_EPSILON * fabs(now->stop_time));
    return larger(rounding, PAST_STOP * now->stop_time - PAST_STOP * now->start_time);
}

static Status check_times(Instance *instance, double time, double h) {
    const Dynamics *now = &instance->now;
    /* isfinite(h) beside h > 0.0 would cost twenty instructions more: clang joins them to one test of h's bits */
    if (!(isgreater(h, 0.0) && islessequal(h, DBL_MAX)))
        return instance_error(instance, "communicationStepSize = %.10g s: must be finite and > 0", h);
    if (!(fabs(time - now->values[REFERENCE_TIME]) <= time_slack(now, 0.0)))
        return instance_error(instance, "currentCommunicationPoint = %.17g s: must be the instance's time %.17g s",
                              time, now->values[REFERENCE_TIME]);
    if (!isfinite(time + h))
        return instance_error(instance, "the step from %.17g s by %.10g s ends beyond all finite times", time, h);
    if (now->stop_time_defined && (time + h) - now->stop_time > stop_slack(now, h))
        return instance_error(instance, "the step from %.17g s by %.10g s passes stopTime = %.17g s", time, h,
                              now->stop_time);
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
    /* isless, unlike <, raises no floating-point exception for a NaN */
    if (!wanted || !instance->early_return_allowed || !isless(early, end)) return end;
    return larger(early, instance->now.values[REFERENCE_TIME]);
}

/* What rounding of the composite's tensor turns the body by [rad], `elapsed` after it was at x. */
static double turned_by_rounding(Instance *instance, const double x[], double elapsed) {
#if ROUNDING
    double angle;
    instance_set_arguments(instance);
    instance->arg[0] = x;
    instance->arg[3] = &elapsed;
    instance->res[0] = &angle;
    rounding(instance->arg, instance->res, instance->iw, instance->w, 0);
    return angle;
#else
    (void)instance, (void)x, (void)elapsed;
    return 0.0;
#endif
}

static void begin(Progress *progress, double h) {
    progress->h = progress->remaining = h;
    progress->taken = progress->error = progress->next_size = 0.0;
    progress->found[0] = progress->found[1] = 0.0;
    progress->was_free = false;
    progress->exponent = 0;
}

Status solver_step(Instance *instance, double time, double h, bool *ended_early) {
    Dynamics *now = &instance->now;
    *ended_early = false;
    Status status = check_times(instance, time, h);
    if (status == STATUS_OK) status = composite_refresh(instance);
    if (status == STATUS_OK) status = field_check(instance);
    if (status == STATUS_OK) status = actions_check(instance);
    if (status != STATUS_OK) return status;
    field_begin(instance);
    Progress progress;
    begin(&progress, h);
    double start[STATE_COUNT], end = time + h;
    const double start_time = now->values[REFERENCE_TIME], start_errors[2] = {now->errors[0], now->errors[1]};
    double start_bound[sizeof now->bound / sizeof *now->bound];
    memcpy(start_bound, now->bound, sizeof start_bound);
    memcpy(start, instance_x(instance), sizeof start);
    bound_over_change(instance);
    const Call *call = instance->call;
    while (progress.remaining > 0.0) {
        instance->call = call;
        double before[ERROR_BOUND ? STATE_COUNT : 1];
        if (ERROR_BOUND) memcpy(before, instance_x(instance), sizeof before);
        const double left = progress.remaining;
        status = solver_advance(instance, &progress);
        instance_state_moved(instance);
        if (status != STATUS_OK) {
            memcpy(instance_x(instance), start, sizeof start);
            now->values[REFERENCE_TIME] = start_time;
            memcpy(now->errors, start_errors, sizeof start_errors);
            memcpy(now->bound, start_bound, sizeof start_bound);
            field_end(instance);
            return status;
        }
        now->values[REFERENCE_TIME] = progress.remaining > 0.0 ? end - progress.remaining : end;
        bound_over_sub_step(instance, before, left - progress.remaining, &progress);
        now->errors[ESTIMATE] =
            progress.error + turned_by_rounding(instance, start, now->values[REFERENCE_TIME] - start_time);
        if (!instance->sub_step_ended) continue;
        const double wanted = listen(instance, end);
        if (now->state == TERMINATED) {
            field_arrive(instance);
            field_end(instance);
            return STATUS_ERROR;
        }
        if (wanted < end) {
            *ended_early = true;
            end = wanted;
            progress.remaining = end - now->values[REFERENCE_TIME];
        }
    }
    field_arrive(instance);
    field_end(instance);
    now->epoch_holds = progress.was_free;
    memcpy(now->stepped_p, now->p, sizeof now->p);
    bound_remember(instance);
    return STATUS_OK;
}
