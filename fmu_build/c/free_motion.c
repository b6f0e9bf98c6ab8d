/* Free motion: exact for any time that turns the body by no more than LARGEST_TURN. Rates and moments are scaled by
   powers of two, the model gives the motion over a first angle, and doublings of that reach the rest.

   Needs of the model: free_phase, free_start, free_double, free_finish; the free part of a. */
#include "free_motion.h"

#include <string.h>

#include "composite.h"
#include "model.h"

/* A tumble from a spin about the middle axis grows by a factor e per radian of phase at most. A rate that is tiny beside
   the others is followed in pieces of LONGEST_TINY until it is not, or for so many pieces that it never will be. */
static const double TINY = 0x1p-400;
static const double LONGEST_TINY = 16.0; /* rad */
enum { MOST_PIECES = 48 };

Scaled free_scaled(const Instance *instance, const double x[], double time) {
    Scaled scaled;
    memcpy(scaled.x, x, sizeof scaled.x);
    memcpy(scaled.a, instance->now.a, sizeof scaled.a);
    int of_moments;
    frexp(scaled.a[AXES_FREE + 2], &of_moments);
    frexp(fmax(fabs(x[4]), fmax(fabs(x[5]), fabs(x[6]))), &scaled.exponent);
    for (size_t i = AXES_FREE; i < AXES_FREE + 3; i++) scaled.a[i] = ldexp(scaled.a[i], -of_moments);
    for (size_t i = 4; i < STATE_COUNT; i++) scaled.x[i] = ldexp(scaled.x[i], -scaled.exponent);
    scaled.time = ldexp(time, scaled.exponent);
    return scaled;
}

static double phase_of(Instance *instance, const Scaled *scaled) {
    double phase;
    instance->arg[0] = scaled->x;
    instance->arg[1] = scaled->a;
    instance->arg[2] = &scaled->time;
    instance->res[0] = &phase;
    free_phase(instance->arg, instance->res, instance->iw, instance->w, 0);
    return phase;
}

static void follow(Instance *instance, const Scaled *scaled, int doublings, double next[]) {
    double v[2][FREE_VARYING], k[FREE_CONSTANT];
    const double share = ldexp(1.0, -doublings);
    instance->arg[0] = scaled->x;
    instance->arg[1] = scaled->a;
    instance->arg[2] = &scaled->time;
    instance->arg[3] = &share;
    instance->res[0] = v[0];
    instance->res[1] = k;
    free_start(instance->arg, instance->res, instance->iw, instance->w, 0);
    instance->arg[1] = k;
    for (int i = 0; i < doublings; i++) {
        instance->arg[0] = v[i % 2];
        instance->res[0] = v[(i + 1) % 2];
        free_double(instance->arg, instance->res, instance->iw, instance->w, 0);
    }
    instance->arg[0] = scaled->x;
    instance->arg[1] = scaled->a;
    instance->arg[3] = v[doublings % 2];
    instance->arg[4] = k;
    instance->res[0] = next;
    free_finish(instance->arg, instance->res, instance->iw, instance->w, 0);
    for (size_t i = 4; i < STATE_COUNT; i++) next[i] = ldexp(next[i], scaled->exponent);
}

bool free_has_tiny_rate(const Scaled *scaled) {
    bool tiny = false;
    for (size_t i = 4; i < STATE_COUNT; i++) tiny = tiny || (scaled->x[i] != 0.0 && fabs(scaled->x[i]) < TINY);
    return tiny;
}

/* One piece of free motion, *time [s] or less: what is left of it is *time. */
static Status free_piece(Instance *instance, double x[], double *time, bool whole) {
    Scaled scaled = free_scaled(instance, x, *time);
    double phase = phase_of(instance, &scaled), taken = *time, next[STATE_COUNT];
    if (!whole && phase > LONGEST_TINY && free_has_tiny_rate(&scaled)) {
        taken = *time * (LONGEST_TINY / phase);
        scaled = free_scaled(instance, x, taken);
        phase = phase_of(instance, &scaled);
    }
    bool finite = isfinite(phase);
    if (finite) {
        int doublings = 0;
        if (phase > FIRST_ANGLE) frexp(phase / FIRST_ANGLE, &doublings);
        follow(instance, &scaled, doublings, next);
        finite = all_finite(next, STATE_COUNT);
    }
    if (!finite)
        return instance_refuse_size(instance,
                                    "free motion over %.10g s from angular_velocity = (%.10g, %.10g, %.10g) rad/s "
                                    "leaves the range of finite numbers",
                                    *time, x[4], x[5], x[6]);
    memcpy(x, next, sizeof next);
    *time -= taken;
    return STATUS_OK;
}

bool free_reaches(const double x[], double time) {
    const double a = x[4] * time, b = x[5] * time, c = x[6] * time;
    return a * a + b * b + c * c <= LARGEST_TURN * LARGEST_TURN;
}

Status free_motion(Instance *instance, const double x[], double time, double next[]) {
    if (!free_reaches(x, time))
        return instance_refuse_size(instance,
                                    "free motion over %.10g s with angular_velocity = (%.10g, %.10g, %.10g) rad/s turns "
                                    "the body by %.3g rad; it is followed for %g rad in a step",
                                    time, x[4], x[5], x[6], hypot(hypot(x[4] * time, x[5] * time), x[6] * time),
                                    LARGEST_TURN);
    composite_refresh_axes(instance);
    memcpy(next, x, STATE_COUNT * sizeof(double));
    if (is_at_rest(x)) return STATUS_OK;
    double left = time;
    Status status = STATUS_OK;
    for (int piece = 0; left != 0.0 && status == STATUS_OK; piece++)
        status = free_piece(instance, next, &left, piece == MOST_PIECES);
    return status;
}
