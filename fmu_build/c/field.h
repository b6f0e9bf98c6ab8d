/* Where the body is in a field of gravity: judged, and followed within a communication step, along which the centre moves
   by two-body motion from what the inputs say at its start. Without a field nothing of this is there.

   Of the instance it owns acting, moved, left and moves. */
#ifndef FIELD_H
#define FIELD_H

#include <string.h>

#include "instance.h"

#if FIELD

/* Judges position and velocity, the composite being current. */
Status field_check(Instance *instance);

/* Position [m] and velocity [m/s] from the centre, inertial axes, within a communication step. */
static inline double *field_of(Instance *instance) {
    return &instance->acting[FIELD_PLACE];
}

/* From here to field_end functions of the model are given `acting`, whose field moves. */
static inline void field_begin(Instance *instance) {
    memcpy(instance->acting, &instance->now.values[REFERENCE_TORQUE], sizeof instance->acting);
    instance->moves = true;
}
static inline void field_end(Instance *instance) {
    instance->moves = false;
}

/* Has the model's step write where the centre is afterwards; once the step is taken, field_move goes on to there. */
static inline void field_result(Instance *instance) {
    instance->res[2] = instance->moved;
}
static inline void field_move(Instance *instance) {
    memcpy(instance->left, field_of(instance), sizeof instance->left);
    memcpy(field_of(instance), instance->moved, sizeof instance->moved);
}

#else

static inline Status field_check(Instance *instance) {
    (void)instance;
    return STATUS_OK;
}
static inline void field_begin(Instance *instance) {
    (void)instance;
}
static inline void field_end(Instance *instance) {
    (void)instance;
}
static inline void field_result(Instance *instance) {
    (void)instance;
}
static inline void field_move(Instance *instance) {
    (void)instance;
}

#endif

#endif
