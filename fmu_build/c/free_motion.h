/* Motion without torque, in one step of any length. */
#ifndef FREE_MOTION_H
#define FREE_MOTION_H

#include <math.h>

#include "instance.h"

/* Whether motion without torque from a state x[STATE_COUNT] over a time [s] turns the body by at most LARGEST_TURN. */
bool free_reaches(const double x[], double time);

/* Carries a state x[STATE_COUNT] on by a time [s] of motion without torque, to next[STATE_COUNT]. Refuses a motion
   that cannot be followed. */
Status free_motion(Instance *instance, const double x[], double time, double next[]);

/* The state and the free part of a, scaled by powers of two so that rates and moments are about 1; the time then is
   about the angle turned. */
typedef struct {
    double x[STATE_COUNT], a[AXES_COUNT], time;
    int exponent; /* of the rates */
} Scaled;

Scaled free_scaled(const Instance *instance, const double x[], double time);

/* Whether a rate is so small beside the others that the product of two such is no double. */
bool free_has_tiny_rate(const Scaled *scaled);

static inline bool is_at_rest(const double x[]) {
    return x[4] == 0.0 && x[5] == 0.0 && x[6] == 0.0;
}

static inline bool all_finite(const double values[], size_t count) {
    bool finite = true;
    for (size_t i = 0; i < count; i++) finite = finite && isfinite(values[i]);
    return finite;
}

#endif
