#include <float.h>
#include <math.h>
#include <string.h>

#include "instance.h"
#include "model.h"
#include "taylor.h"

#if STEPS == STEPS_BY_ANGLE
static const double MOST_SUB_STEPS = 1e7;
#elif STEPS != STEPS_NONE
static const double MOST_SUB_STEPS = 1e6; /* of about ten times the work */
#endif

static const double HALF_ULP = 0.5 * DBL_EPSILON;

#if STEPS != STEPS_BY_ANGLE

/* Sums of three squares of numbers below this do not overflow. */
static const double SQUARABLE = 0x1p510;

static double length_of(const double v[3]) {
    if (fabs(v[0]) < SQUARABLE && fabs(v[1]) < SQUARABLE && fabs(v[2]) < SQUARABLE)
        return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    const double a = v[0] * 0x1p-600, b = v[1] * 0x1p-600, c = v[2] * 0x1p-600;
    return sqrt(a * a + b * b + c * c) * 0x1p600;
}

#endif

static double larger(double a, double b) {
    return a > b ? a : b;
}

#if STEPS == STEPS_BY_SERIES

static double smaller(double a, double b) {
    return a < b ? a : b;
}

#endif

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
    if (now->stop_time_defined && (time + h) - now->stop_time > larger(slack, 4.0 * DBL_EPSILON * fabs(now->stop_time)))
        return instance_error(instance, "the step from %.17g s by %.10g s passes stopTime = %.17g s", time, h,
                              now->stop_time);
    return STATUS_OK;
}

/* How far a communication step has come. */
typedef struct {
    double h, remaining; /* s: its size, and what is left of it */
    double taken;        /* sub-steps, those that were taken again included */
    double error;        /* rad, estimated, at the step's end */
    double next_size;    /* s, of the next sub-step, where the error controls it; 0: not known */
    int exponent;        /* power of a sub-step that its estimated error grows with, once next_size is known */
#if STEPS == STEPS_BY_SERIES
    double acceleration[3]; /* rad/s2, by the torque, once next_size is known */
    double rest[3];         /* rad/s, what rounding has kept from the angular velocity */
    double drift;           /* rad, what other rounding of the angular velocity comes to at the step's end; in error */
#endif
    bool composite_changed; /* since the last communication step */
    bool was_free;
} Progress;

#if STEPS != STEPS_NONE

static bool is_finite(const double x[]) {
    bool finite = true;
    for (size_t i = 0; i < STATE_COUNT; i++) finite = finite && isfinite(x[i]);
    return finite;
}

#endif

#if STEPS == STEPS_BY_ANGLE

/* Takes one sub-step of at most the model's longest, what remains being shared out evenly. */
static Status sub_step(Instance *instance, Progress *progress) {
    double *x = instance_x(instance);
    double square, next[STATE_COUNT], error[2] = {0.0, 0.0};
    instance_set_arguments(instance);
    instance->res[0] = &square;
    fastest_square(instance->arg, instance->res, instance->iw, instance->w, 0);
    double size = progress->remaining, count = 1.0;
    if (!(size * size * square <= MAX_ANGLE_STEP * MAX_ANGLE_STEP)) {
        const double needed = ceil(progress->remaining * sqrt(square) / MAX_ANGLE_STEP);
        count = needed > 1.0 || isnan(needed) ? needed : 1.0;
        size = progress->remaining / count;
    }
    if (!(progress->taken + count <= MOST_SUB_STEPS))
        return instance_refuse(instance,
                               "communicationStepSize = %.10g s needs %.6g sub-steps of max_angle_step = %.10g rad "
                               "with angular_velocity = (%.10g, %.10g, %.10g) rad/s, %.10g s before its end; at most "
                               "%g are taken",
                               progress->h, progress->taken + count, MAX_ANGLE_STEP, x[4], x[5], x[6],
                               progress->remaining, MOST_SUB_STEPS);
    instance->arg[3] = &size;
    instance->res[0] = next;
    instance->res[1] = error;
    step(instance->arg, instance->res, instance->iw, instance->w, 0);
    if (!is_finite(next))
        return instance_refuse(instance,
                               "a sub-step of %.10g s from angular_velocity = (%.10g, %.10g, %.10g) rad/s leaves the "
                               "range of finite numbers",
                               size, x[4], x[5], x[6]);
    progress->taken += 1.0;
    progress->error += error[0] + error[1] * progress->remaining + HALF_ULP;
    memcpy(x, next, sizeof next);
    progress->remaining = count > 1.0 ? progress->remaining - size : 0.0;
    return STATUS_OK;
}

#elif STEPS != STEPS_NONE

#if STEPS == STEPS_BY_SERIES

/* Of the series: what costs least, see supervessel/propagators/taylor.py. */
static int series_order(double tolerance) {
    const int order = 2 * (int)floor(2.75 - 0.29 * log(tolerance));
    return order < TAYLOR_LEAST_ORDER ? TAYLOR_LEAST_ORDER : order > TAYLOR_MOST_ORDER ? TAYLOR_MOST_ORDER : order;
}

#endif

/* From one sub-step to the next the size grows by this factor at most: by it too where the error is less than the share
   NO_ERROR of what is allowed, whose quotient need not be a double. */
static const double MOST_GROWTH = 5.0, NO_ERROR = 0x1p-300;

/* Refuses a step that needs so many sub-steps. */
static Status refuse_count(Instance *instance, const Progress *progress, double count) {
    const double *x = instance_x(instance);
    return instance_refuse(instance,
                           "communicationStepSize = %.10g s needs %.6g sub-steps for tolerance = %.3g with "
                           "angular_velocity = (%.10g, %.10g, %.10g) rad/s, %.10g s before its end; at most %g are "
                           "taken",
                           progress->h, count, instance->now.tolerance, x[4], x[5], x[6], progress->remaining,
                           MOST_SUB_STEPS);
}

/* The size nearest to one whose difference from what remains is a double: times of sub-steps then add up exactly. */
static double without_rest(const Progress *progress, double size) {
    return progress->remaining - (progress->remaining - size);
}

/* Size of the next sub-step [s] by what is known before it. */
static double planned_size(const Progress *progress) {
    const double size = progress->next_size;
    if (!(size < progress->remaining)) return progress->remaining;
    return 2.0 * size > progress->remaining ? 0.5 * progress->remaining : without_rest(progress, size);
}

/* Goes on to next, by a sub-step of that size with an error that is estimated. */
static void go_on(Instance *instance, Progress *progress, const double next[], double size, double error) {
    progress->error += error;
    memcpy(instance_x(instance), next, STATE_COUNT * sizeof(double));
    progress->remaining = size < progress->remaining ? progress->remaining - size : 0.0;
}

/* Size of the first sub-step [s]. Below an angle that any tolerance allows nothing needs to be asked. */
static double first_size(Instance *instance, const Progress *progress) {
#if FREE == FREE_BETWEEN_KICKS
    (void)instance; /* only the torque's strength limits it, and the first estimate tells */
    return progress->h;
#else
    double rates[STATE_COUNT];
    instance_set_arguments(instance);
    instance->res[0] = rates;
    ode(instance->arg, instance->res, instance->iw, instance->w, 0);
    const double speed = length_of(instance_x(instance) + 4) + sqrt(length_of(rates + 4));
    if (speed * progress->h <= 0.02) return progress->h;
    return 2.0 * pow(instance->now.tolerance, 1.0 / progress->exponent) / speed;
#endif
}

#if STEPS == STEPS_BY_SERIES

/* An error of the rate turns the body on for what remains, but those of many sub-steps nearly cancel: one counts for
   this angle [rad] and this share of what remains at most (measured in tests/stability/test_tolerances.py). */
static const double TURNED_ON = 3.0, TURNED_ON_SHARE = 0.1;

/* A sub-step may exceed by this factor the span that its series were made for. */
static const double LONGEST_SHARE = 1.2;

/* What of the error allowed a sub-step aims at: the estimate at another size than the series' is itself estimated. */
static const double AIM = 0.8;

/* What the error `found` at the communication step's end is where a sub-step's errors of attitude and rate, the larger
   of the two by its own size, are no more than rounding. A body that neither turns nor accelerates has no errors. Divisors
   are guarded, not divisions: compilers may divide before they ask. */
static double rounding_of(double found, const double error[2], double speed) {
    const double worst = larger(error[0], error[1] / (speed > 0.0 ? speed : 1.0));
    return HALF_ULP * (found / (worst > 0.0 ? worst : 1.0));
}

/* For how long [s] an error of the rate counts. */
static double reach_of(double remaining, double speed) {
    if (!(speed > 0.0)) return remaining;
    const double left = larger(remaining, 1.0 / speed);
    return smaller(left, TURNED_ON / speed + TURNED_ON_SHARE * left);
}

static void begin_series(Instance *instance, Progress *progress) {
    composite_refresh_axes(instance);
    progress->exponent = series_order(instance->now.tolerance) + 1;
    instance->arg[0] = &instance->now.values[REFERENCE_TORQUE];
    instance->arg[1] = instance->now.c;
    instance->res[0] = progress->acceleration;
    by_torque(instance->arg, instance->res, instance->iw, instance->w, 0);
    progress->next_size = first_size(instance, progress);
}

/* Takes one sub-step whose estimated error, as it shows at the communication step's end, stays within its share of the
   tolerance by time, or within rounding. Series hold for any time: they are summed up at that which the error allows,
   and no sub-step is taken again but for lack of finite numbers. */
static Status sub_step(Instance *instance, Progress *progress) {
    if (progress->next_size == 0.0) begin_series(instance, progress);
    const double *x = instance_x(instance), *map = &instance->now.a[AXES_SERIES];
    Series series;
    series.order = progress->exponent - 1;
    for (;;) {
        const double size = planned_size(progress);
        progress->taken += 1.0;
        const double count = progress->taken - 1.0 + progress->remaining / size;
        if (!(count <= MOST_SUB_STEPS)) return refuse_count(instance, progress, count);
        taylor_series(x, progress->acceleration, map, size, &series);
        const double speed = length_of(series.rates[0]) + length_of(series.rates[1]);
        const double reach = reach_of(progress->remaining, speed);
        const double found = series.error[0] + series.error[1] * reach;
        const double rounding = rounding_of(found, series.error, speed);
        const double allowed = larger(SAFETY * instance->now.tolerance * (size / progress->h), rounding);
        const bool seen = found > NO_ERROR * allowed;
        const double best = seen ? pow(AIM * allowed / found, 1.0 / series.order) : MOST_GROWTH;
        double taken = size, next[STATE_COUNT];
        if (!(found <= allowed)) taken = without_rest(progress, best * size);
        else if (best > 1.0 && 2.0 * LONGEST_SHARE * size < progress->remaining)
            taken = without_rest(progress, smaller(best, LONGEST_SHARE) * size);
        const double share = taken / size;
        double rest[3];
        memcpy(rest, progress->rest, sizeof rest);
        taylor_sum(&series, x, map, share, next, rest);
        if (isfinite(found) && is_finite(next)) {
            const double error = share == 1.0 ? found : AIM * allowed * share;
            const double turned_on = 2.0 * HALF_ULP * speed * progress->remaining; /* adds up as a random walk does */
            const double drift = sqrt(progress->drift * progress->drift + turned_on * turned_on);
            memcpy(progress->rest, rest, sizeof rest);
            go_on(instance, progress, next, taken, error + HALF_ULP * (1.0 + speed * size) + (drift - progress->drift));
            progress->drift = drift;
            progress->next_size = size * smaller(best, MOST_GROWTH);
            return STATUS_OK;
        }
        progress->next_size = 0.2 * size;
    }
}

#else

static void call_step(Instance *instance, const double x[], double size, double next[], double error[2]) {
    instance_set_arguments(instance);
    instance->arg[0] = x;
    instance->arg[3] = &size;
    instance->res[0] = next;
    instance->res[1] = error;
    step(instance->arg, instance->res, instance->iw, instance->w, 0);
}

/* By size [s] to next; error: estimates of the attitude's [rad] and the rate's [rad/s]. */
static Status take_step(Instance *instance, double size, double next[], double error[2]) {
    call_step(instance, instance_x(instance), size, next, error);
#if FREE == FREE_BETWEEN_KICKS
    double kicked[STATE_COUNT], drifted[STATE_COUNT], again[2];
    memcpy(kicked, next, sizeof kicked);
    const Status status = free_motion(instance, kicked, size, drifted);
    if (status != STATUS_OK) return status;
    call_step(instance, drifted, size, next, again);
#endif
    return STATUS_OK;
}

/* Takes one sub-step whose estimated error, as it shows at the communication step's end, stays within its share of the
   tolerance by time, or within what rounding amounts to there; one that misses it is taken again, shorter. An error of
   the rate turns the body on for what remains, but counts no less than relative to the rate. */
static Status sub_step(Instance *instance, Progress *progress) {
    const double *x = instance_x(instance);
    double next[STATE_COUNT], error[2];
    if (progress->next_size == 0.0) {
        progress->exponent = ERROR_EXPONENT;
        progress->next_size = first_size(instance, progress);
    }
    const double tolerance = instance->now.tolerance, power = 1.0 / (progress->exponent - 1.0);
    for (;;) {
        const double size = planned_size(progress);
        progress->taken += 1.0;
        const double count = progress->taken - 1.0 + progress->remaining / size;
        if (!(count <= MOST_SUB_STEPS)) return refuse_count(instance, progress, count);
        const Status status = take_step(instance, size, next, error);
        if (status != STATUS_OK) return status;
        const double speed = larger(length_of(x + 4), length_of(next + 4));
        const double reach = speed > 0.0 ? larger(progress->remaining, 1.0 / speed) : progress->remaining;
        const double rounding = HALF_ULP * (1.0 + speed * reach);
        const double allowed = larger(SAFETY * tolerance * (size / progress->h), rounding);
        const double found = error[0] + error[1] * reach;
        const bool usable = is_finite(next) && isfinite(found);
        if (usable && found <= allowed) {
            go_on(instance, progress, next, size, found + HALF_ULP * (1.0 + speed * size));
            if (progress->remaining == 0.0) return STATUS_OK;
            const double best = found > NO_ERROR * allowed ? 0.9 * pow(allowed / found, power) : MOST_GROWTH;
            progress->next_size = size * fmin(MOST_GROWTH, best);
            return STATUS_OK;
        }
        progress->next_size = size * (usable ? larger(0.2, 0.9 * pow(allowed / found, power)) : 0.2);
    }
}

#endif

#endif

#if FREE == FREE_ALWAYS || FREE == FREE_WHILE_FREE

static bool is_free(const Instance *instance) {
    const double *torque = &instance->now.values[REFERENCE_TORQUE];
    bool zero = true;
    for (size_t i = INPUT_U_COUNT; i > 0; i--) zero = zero && torque[i - 1] == 0.0;
#if SPINS
    for (size_t i = 0; i < 3; i++) zero = zero && instance->now.c[COMPOSITE_SPIN + i] == 0.0;
#endif
    return zero;
}

#if FREE == FREE_ALWAYS

/* Names what keeps the motion from being free. */
static Status refuse_action(Instance *instance) {
    static const char reason[] = "must be 0 for the propagator exact, which knows free motion alone";
    for (size_t i = REFERENCE_TORQUE; i < REFERENCE_TORQUE + INPUT_U_COUNT; i += 3) {
        const double *v = &instance->now.values[i];
        if (v[0] == 0.0 && v[1] == 0.0 && v[2] == 0.0) continue;
        const Variable *variable = &VARIABLES[i];
        return instance_refuse(instance, "%.*s = (%.10g, %.10g, %.10g) %s: %s", (int)strcspn(variable->name, "["),
                               variable->name, v[0], v[1], v[2], variable->unit, reason);
    }
#if SPINS
    const double *h = &instance->now.c[COMPOSITE_SPIN];
    return instance_refuse(instance, "the ports that move give the vessels (%.10g, %.10g, %.10g) N.m.s: %s", h[0], h[1],
                           h[2], reason);
#else
    return STATUS_OK;
#endif
}

#endif

/* Takes the whole step from where the motion became free, so that rounding does not pile up over steps; or, if that is
   too many turns away, from now on. */
static Status free_step(Instance *instance, Progress *progress) {
    Dynamics *now = &instance->now;
    double *x = instance_x(instance), next[STATE_COUNT];
    double elapsed = now->elapsed + progress->h; /* Knuth's sum: elapsed and rest together are exact */
    const double added = elapsed - now->elapsed;
    double rest = now->elapsed_rest + ((now->elapsed - (elapsed - added)) + (progress->h - added));
    const bool goes_on =
        now->epoch_holds && !progress->composite_changed && free_reaches(now->epoch, elapsed + rest);
    if (!goes_on) elapsed = progress->h, rest = 0.0;
    const Status status = goes_on ? free_motion_from_epoch(instance, elapsed + rest, next)
                                  : free_motion(instance, x, elapsed + rest, next);
    if (status != STATUS_OK) return status;
    if (!goes_on) {
        memcpy(now->epoch, x, sizeof now->epoch);
        now->epoch_step = EPOCH_NEW;
    }
    now->elapsed = elapsed;
    now->elapsed_rest = rest;
    now->epoch_holds = true;
    progress->error = 8.0 * HALF_ULP * (1.0 + length_of(x + 4) * progress->h);
    memcpy(x, next, sizeof next);
    progress->remaining = 0.0;
    return STATUS_OK;
}

#endif

/* Goes on by one sub-step: the state, what remains of the step and the error change with it. */
static Status advance(Instance *instance, Progress *progress) {
#if FREE == FREE_ALWAYS
    progress->was_free = is_free(instance);
    if (progress->was_free) return free_step(instance, progress);
    return refuse_action(instance);
#elif FREE == FREE_WHILE_FREE
    progress->was_free = !progress->composite_changed && is_free(instance);
    return progress->was_free ? free_step(instance, progress) : sub_step(instance, progress);
#else
    return sub_step(instance, progress);
#endif
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
    Progress progress = {.h = h, .remaining = h};
    progress.composite_changed = memcmp(now->p, now->stepped_p, sizeof now->p) != 0;
    double start[STATE_COUNT], end = time + h;
    const double start_time = now->values[REFERENCE_TIME], start_error = now->error_estimate;
    memcpy(start, instance_x(instance), sizeof start);
    const Call *call = instance->call;
    while (progress.remaining > 0.0) {
        instance->call = call;
        status = advance(instance, &progress);
        instance_state_moved(instance);
        if (status != STATUS_OK) {
            memcpy(instance_x(instance), start, sizeof start);
            now->values[REFERENCE_TIME] = start_time;
            now->error_estimate = start_error;
            return status;
        }
        now->values[REFERENCE_TIME] = progress.remaining > 0.0 ? end - progress.remaining : end;
        now->error_estimate = progress.error;
        if (!instance->sub_step_ended) continue;
        const double wanted = listen(instance, end);
        if (now->state == TERMINATED) return STATUS_ERROR;
        if (wanted < end) {
            *ended_early = true;
            end = wanted;
            progress.remaining = end - now->values[REFERENCE_TIME];
        }
    }
    now->epoch_holds = progress.was_free;
    memcpy(now->stepped_p, now->p, sizeof now->p);
    return STATUS_OK;
}
