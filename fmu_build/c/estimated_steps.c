/* What methods have in common that find the size of their sub-steps by an estimated error: dop853, split, taylor.

   Needs of the model: ode; with wheels or jet damping fastest_square, a bound of the rate. */
#include "estimated_steps.h"

#include "model.h"

Status estimated_refuse_count(Instance *instance, const Progress *progress, double count) {
    const double *x = instance_x(instance);
    return instance_refuse_size(instance,
                                "communicationStepSize = %.10g s needs %.6g sub-steps for tolerance = %.3g with "
                                "angular_velocity = (%.10g, %.10g, %.10g) rad/s, %.10g s before its end; at most %g are "
                                "taken",
                                progress->h, count, instance->now.tolerance, x[4], x[5], x[6], progress->remaining,
                                MOST_SUB_STEPS);
}

/* Below an angle that any tolerance allows nothing needs to be asked. The momentum of wheels turns a rate faster than the
   body turns, and jet damping makes it decay: stages far beyond that time would leave the range of doubles. */
double estimated_first_size(Instance *instance, const Progress *progress) {
    double rates[STATE_COUNT];
    instance_set_arguments(instance);
    instance->res[0] = rates;
    ode(instance->arg, instance->res, instance->iw, instance->w, 0);
    double speed = length_of(instance_x(instance) + 4) + sqrt(length_of(rates + 4));
#ifdef BOUNDS_FIRST_SIZE
    double square;
    instance->res[0] = &square;
    fastest_square(instance->arg, instance->res, instance->iw, instance->w, 0);
    speed = larger(speed, 0.5 * sqrt(square)); /* a bound that is twice as large as what it bounds, and more */
#endif
    if (speed * progress->h <= 0.02) return progress->h;
    return 2.0 * pow(instance->now.tolerance, 1.0 / progress->exponent) / speed;
}
