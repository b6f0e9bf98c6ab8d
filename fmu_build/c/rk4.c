/* Sub-steps of the propagator rk4, as many as keep the angle turned in one within max_angle_step.

   Needs of the model: step (one step and the estimate of its error), fastest_square (a bound of the rate). */
#include <string.h>

#include "field.h"
#include "model.h"
#include "solver.h"

static const double MOST_SUB_STEPS = 1e7;

/* Takes one sub-step of at most the model's longest, what remains being shared out evenly. */
Status solver_sub_step(Instance *instance, Progress *progress) {
    double *x = instance_x(instance);
    double square, next[STATE_COUNT], *error = progress->found;
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
        return instance_refuse_size(instance,
                                    "communicationStepSize = %.10g s needs %.6g sub-steps of max_angle_step = %.10g rad "
                                    "with angular_velocity = (%.10g, %.10g, %.10g) rad/s, %.10g s before its end; at most "
                                    "%g are taken",
                                    progress->h, progress->taken + count, MAX_ANGLE_STEP, x[4], x[5], x[6],
                                    progress->remaining, MOST_SUB_STEPS);
    instance->arg[3] = &size;
    instance->res[0] = next;
    instance->res[1] = error;
    field_result(instance);
    step(instance->arg, instance->res, instance->iw, instance->w, 0);
    if (!is_finite(next))
        return instance_refuse_size(instance,
                                    "a sub-step of %.10g s from angular_velocity = (%.10g, %.10g, %.10g) rad/s leaves the "
                                    "range of finite numbers",
                                    size, x[4], x[5], x[6]);
    progress->taken += 1.0;
    progress->error += error[0] + error[1] * progress->remaining + HALF_ULP;
    memcpy(x, next, sizeof next);
    field_move(instance);
    progress->remaining = count > 1.0 ? progress->remaining - size : 0.0;
    return STATUS_OK;
}
