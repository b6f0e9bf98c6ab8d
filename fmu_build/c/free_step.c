/* Communication steps of free motion, of the propagators exact and auto: each from the epoch, the instant at which the
   motion became free, and not from the step before.

   Owns epoch, elapsed, from_epoch and epoch_step of Dynamics; the solver drops the epoch where a step was not free.
   Needs of the model: free_constants, free_at, and what free_motion.c needs. */
#include "free_step.h"

#include <stdlib.h>
#include <string.h>

#include "composite.h"
#include "free_motion.h"
#include "model.h"

/* By which rates may have to be divided for free_at: beyond, its constants would be no normal doubles. */
enum { LARGEST_EXPONENT = 900 };

/* Makes now.from_epoch. Returns whether it serves. */
static bool find_constants(Instance *instance) {
    Dynamics *now = &instance->now;
    if (is_at_rest(now->epoch)) return false;
    composite_refresh_axes(instance);
    const Scaled scaled = free_scaled(instance, now->epoch, 0.0);
    if (free_has_tiny_rate(&scaled) || abs(scaled.exponent) > LARGEST_EXPONENT) return false;
    const double unit = ldexp(1.0, scaled.exponent);
    instance->arg[0] = scaled.x;
    instance->arg[1] = scaled.a;
    instance->arg[2] = &unit;
    instance->res[0] = now->from_epoch;
    free_constants(instance->arg, instance->res, instance->iw, instance->w, 0);
    return all_finite(now->from_epoch, FREE_START);
}

/* Motion from now.epoch, at a small cost from its second time on. */
static Status free_motion_from_epoch(Instance *instance, double time, double next[]) {
    Dynamics *now = &instance->now;
    if (now->epoch_step == EPOCH_NEW) now->epoch_step = find_constants(instance) ? EPOCH_SERVED : EPOCH_DOUBLED;
    if (now->epoch_step == EPOCH_DOUBLED) return free_motion(instance, now->epoch, time, next);
    instance->arg[0] = now->from_epoch;
    instance->arg[1] = &time;
    instance->res[0] = next;
    free_at(instance->arg, instance->res, instance->iw, instance->w, 0);
    return STATUS_OK;
}

bool is_free(const Instance *instance) {
    const double *torque = &instance->now.values[REFERENCE_TORQUE];
    bool zero = true;
    for (size_t i = INPUT_U_COUNT; i > 0; i--) zero = zero && torque[i - 1] == 0.0;
    for (size_t i = 0; i < 3 && SPINS; i++) zero = zero && instance->now.c[COMPOSITE_SPIN + i] == 0.0;
    return zero;
}

Status free_step(Instance *instance, Progress *progress, bool changed) {
    Dynamics *now = &instance->now;
    double *x = instance_x(instance), next[STATE_COUNT];
    double elapsed = now->elapsed + progress->h; /* Knuth's sum: elapsed and rest together are exact */
    const double added = elapsed - now->elapsed;
    double rest = now->elapsed_rest + ((now->elapsed - (elapsed - added)) + (progress->h - added));
    const bool goes_on = now->epoch_holds && !changed && free_reaches(now->epoch, elapsed + rest);
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
