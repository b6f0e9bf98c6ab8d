/* A sub-step of the propagator split: half of the torque's kick, free motion, the other half. The model's step is the
   half kick with an estimate of the whole sub-step's error. */
#include <string.h>

#include "free_motion.h"
#include "tried_steps.h"

/* The whole step: only the torque's strength limits a sub-step, and the first estimate tells that. */
double tried_first_size(Instance *instance, const Progress *progress) {
    (void)instance;
    return progress->h;
}

Status tried_step(Instance *instance, double size, double next[], double error[2]) {
    double kicked[STATE_COUNT], drifted[STATE_COUNT], again[2];
    tried_call(instance, instance_x(instance), size, next, error);
    memcpy(kicked, next, sizeof kicked);
    const Status status = free_motion(instance, kicked, size, drifted);
    if (status != STATUS_OK) return status;
#if FIELD
    double begun[6], ended[6];
    memcpy(begun, field_of(instance), sizeof begun);
    memcpy(ended, instance->moved, sizeof ended);
    memcpy(field_of(instance), ended, sizeof ended);
    tried_call(instance, drifted, size, next, again);
    memcpy(field_of(instance), begun, sizeof begun);
    memcpy(instance->moved, ended, sizeof ended);
#else
    tried_call(instance, drifted, size, next, again);
#endif
    return STATUS_OK;
}
