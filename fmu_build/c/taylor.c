/* Sub-steps of the propagator taylor: how long the series of taylor_series.c are followed, by the estimate of their
   error.

   Needs of the model: by_torque, the acceleration by torque, and the map in a that says what the law's products are;
   with wheels held, the momentum that they hold and its rate, with jet damping damping, what it makes of a rate, and
   with either what estimated_steps.c needs. */
#include <string.h>

#include "composite.h"
#include "estimated_steps.h"
#include "model.h"
#include "taylor_series.h"

/* Of the series: what costs least, as taylor_order of supervessel/rotation/propagators/taylor.py has it. */
static int series_order(double tolerance) {
    const int order = 2 * (int)floor(TAYLOR_HALF_ORDER_AT_1 - TAYLOR_HALF_ORDER_SLOPE * log(tolerance));
    return order < TAYLOR_LEAST_ORDER ? TAYLOR_LEAST_ORDER : order > TAYLOR_MOST_ORDER ? TAYLOR_MOST_ORDER : order;
}

static double smaller(double a, double b) {
    return a < b ? a : b;
}

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
    memset(progress->rest, 0, sizeof progress->rest);
    progress->drift = 0.0;
    composite_refresh_axes(instance);
    progress->exponent = series_order(instance->now.tolerance) + 1;
    instance->arg[0] = &instance->now.values[REFERENCE_TORQUE];
    instance->arg[1] = instance->now.c;
    instance->res[0] = progress->acceleration;
    by_torque(instance->arg, instance->res, instance->iw, instance->w, 0);
#ifdef FLOW_COUNT
    instance->res[0] = progress->damping;
    damping(instance->arg, instance->res, instance->iw, instance->w, 0);
#endif
    progress->next_size = estimated_first_size(instance, progress);
}

/* Takes one sub-step whose estimated error, as it shows at the communication step's end, stays within its share of the
   tolerance by time, or within rounding. Series hold for any time: they are summed up at that which the error allows,
   and no sub-step is taken again but for lack of finite numbers. */
Status solver_sub_step(Instance *instance, Progress *progress) {
    if (progress->next_size == 0.0) begin_series(instance, progress);
    const double *x = instance_x(instance), *map = &instance->now.a[AXES_SERIES];
    Series series;
    series.order = progress->exponent - 1;
#ifdef AXES_RESPONSE
    double stored[STATE_COUNT - 1];
    instance_set_arguments(instance);
    instance->res[0] = stored;
    held(instance->arg, instance->res, instance->iw, instance->w, 0);
    series.held = stored;
    series.response = &instance->now.a[AXES_RESPONSE];
#endif
#ifdef FLOW_COUNT
    series.damping = progress->damping;
#endif
#if FIELD
    series.field = field_of(instance);
    series.gradient = &instance->now.a[AXES_GRADIENT];
#endif
    for (;;) {
        const double size = planned_size(progress);
        progress->taken += 1.0;
        const double count = progress->taken - 1.0 + progress->remaining / size;
        if (!(count <= MOST_SUB_STEPS)) return estimated_refuse_count(instance, progress, count);
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
#ifdef AXES_RESPONSE
        for (size_t i = 7; i < STATE_COUNT; i++) next[i] = x[i] + taken * stored[i - 1];
#endif
        if (isfinite(found) && is_finite(next)) {
            const double error = share == 1.0 ? found : AIM * allowed * share;
            const double part = share == 1.0 ? 1.0 : error / (found > 0.0 ? found : 1.0);
            progress->found[0] = part * series.error[0];
            progress->found[1] = part * series.error[1];
            const double turned_on = 2.0 * HALF_ULP * speed * progress->remaining; /* adds up as a random walk does */
            const double drift = sqrt(progress->drift * progress->drift + turned_on * turned_on);
            memcpy(progress->rest, rest, sizeof rest);
#if FIELD
            taylor_sum_field(&series, map, share, next, instance->moved);
#endif
            go_on(instance, progress, next, taken, error + HALF_ULP * (1.0 + speed * size) + (drift - progress->drift));
            progress->drift = drift;
            progress->next_size = size * smaller(best, MOST_GROWTH);
            return STATUS_OK;
        }
        progress->next_size = 0.2 * size;
    }
}
