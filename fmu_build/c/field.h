/* Where the body is in a field of gravity: judged, and followed within a communication step, along which the centre moves
   by two-body motion from what the inputs say at its start. At the end of the step it is where it has moved to, until
   a place is set: what is read there is that of the end. Without a field nothing of this is there.

   Of the instance it owns acting, moved, left and moves, and of Dynamics place and place_holds. */
#ifndef FIELD_H
#define FIELD_H

#include <math.h>
#include <string.h>

#include "instance.h"

#if FIELD

/* m: the inverse of its square is an ordinary number. */
static const double FARTHER = 0x1p-60;

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
    instance->outputs_are_current = instance->rates_are_current = false;
}

/* The step is taken: the centre is where it has moved to. */
static inline void field_arrive(Instance *instance) {
    memcpy(instance->now.place, field_of(instance), sizeof instance->now.place);
    instance->now.place_holds = true;
}

/* The centre is where the inputs say, if one of them has been set that says it. */
static inline void field_set(Instance *instance, size_t reference) {
    if (reference < REFERENCE_TORQUE + FIELD_PLACE || reference >= REFERENCE_TORQUE + FIELD_PLACE + 6) return;
    if (instance->now.place_holds) instance->outputs_are_current = instance->rates_are_current = false;
    instance->now.place_holds = false;
}

/* Writes the rate of the place among those of the inputs u; no output follows from the velocity. */
static inline void field_vary(const Instance *instance, double rates[INPUT_U_COUNT]) {
    const double *set = &instance->now.values[REFERENCE_TORQUE + FIELD_PLACE];
    memcpy(&rates[FIELD_PLACE], (instance->now.place_holds ? instance->now.place : set) + 3, 3 * sizeof(double));
}

/* Whether the distance is no number that overflows when something is divided by its powers. */
static inline bool field_is_ordinary(const Instance *instance) {
    const double *r = &instance->now.values[REFERENCE_TORQUE + FIELD_PLACE];
    return fabs(r[0]) >= FARTHER || fabs(r[1]) >= FARTHER || fabs(r[2]) >= FARTHER;
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
static inline void field_arrive(Instance *instance) {
    (void)instance;
}
static inline void field_set(Instance *instance, size_t reference) {
    (void)instance, (void)reference;
}
static inline void field_vary(const Instance *instance, double rates[]) {
    (void)instance, (void)rates;
}
static inline bool field_is_ordinary(const Instance *instance) {
    (void)instance;
    return true;
}
static inline void field_result(Instance *instance) {
    (void)instance;
}
static inline void field_move(Instance *instance) {
    (void)instance;
}

#endif

#endif
