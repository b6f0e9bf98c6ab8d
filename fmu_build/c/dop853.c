/* A sub-step of the propagator dop853: one step of the model's, which carries its error estimate. */
#include "tried_steps.h"

double tried_first_size(Instance *instance, const Progress *progress) {
    return estimated_first_size(instance, progress);
}

Status tried_step(Instance *instance, double size, double next[], double error[2]) {
    tried_call(instance, instance_x(instance), size, next, error);
    return STATUS_OK;
}
