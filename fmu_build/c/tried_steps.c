/* Sub-steps of methods that try a size and take a shorter one where the estimated error exceeds its share of the
   tolerance: dop853 and split, whose files say what one is.

   Needs of the model: step, one step and the estimate of its error; with wheels or jet damping what estimated_steps.c needs. */
#include "tried_steps.h"

#include "model.h"

void tried_call(Instance *instance, const double x[], double size, double next[], double error[2]) {
    instance_set_arguments(instance);
    instance->arg[0] = x;
    instance->arg[3] = &size;
    instance->res[0] = next;
    instance->res[1] = error;
    field_result(instance);
    step(instance->arg, instance->res, instance->iw, instance->w, 0);
}

/* Takes one sub-step whose estimated error, as it shows at the communication step's end, stays within its share of the
   tolerance by time, or within what rounding amounts to there; one that misses it is taken again, shorter. An error of
   the rate turns the body on for what remains, but counts no less than relative to the rate. */
Status solver_sub_step(Instance *instance, Progress *progress) {
    const double *x = instance_x(instance);
    double next[STATE_COUNT], *error = progress->found;
    if (progress->next_size == 0.0) {
        progress->exponent = ERROR_EXPONENT;
        progress->next_size = tried_first_size(instance, progress);
    }
    const double tolerance = instance->now.tolerance, power = 1.0 / (progress->exponent - 1.0);
    for (;;) {
        const double size = planned_size(progress);
        progress->taken += 1.0;
        const double count = progress->taken - 1.0 + progress->remaining / size;
        if (!(count <= MOST_SUB_STEPS)) return estimated_refuse_count(instance, progress, count);
        const Status status = tried_step(instance, size, next, error);
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
