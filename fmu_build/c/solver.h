/* A communication step of co-simulation, and what its sub-steps have in common.

   Where to look for what decides a step (each FMU has only the files that its scene needs):
     the step as a whole, its times, early return          solver.c
     free motion or a sub-step of a method: solver_advance  one of every_step.c, exact.c, while_free.c
     a sub-step and its size: solver_sub_step
       rk4, size by the angle turned                       rk4.c
       taylor, size by the estimated error of the series   taylor.c, taylor_series.c
       dop853, split, size tried and taken again shorter   tried_steps.c with dop853.c or split.c
       size and growth by an estimated error               estimated_steps.c
     a step of free motion                                 free_step.c, free_motion.c */
#ifndef SOLVER_H
#define SOLVER_H

#include <float.h>
#include <math.h>

#include "instance.h"

/* How far a communication step has come. */
typedef struct {
    double h, remaining; /* s: its size, and what is left of it */
    double taken;        /* sub-steps, those that were taken again included */
    double error;        /* rad, estimated, at the step's end */
    double found[2];     /* rad, rad/s: estimated, that the last sub-step added */
    bool was_free;       /* its last sub-step */
    double next_size;    /* s, of the next sub-step, where the error controls it; 0: not known, nor is what follows */
    int exponent;        /* power of a sub-step that its estimated error grows with; 0 where none controls it */

    /* where series are followed */
    double acceleration[3]; /* rad/s2, by the torque */
#ifdef FLOW_COUNT
    double damping[9];      /* 1/s, of jet damping, see taylor_series.h */
#endif
    double rest[3];         /* rad/s, what the angular velocity lacks by rounding: carried on (compensated sum) */
    double drift;           /* rad, by other rounding of the angular velocity, at the step's end; part of error */
} Progress;

/* Advances the state from time [s] by one communication step of size h [s], or to where the importer wants it to end
   early. */
Status solver_step(Instance *instance, double time, double h, bool *ended_early);

/* Goes on by one sub-step: the state, what remains of the step and the error change with it. */
Status solver_advance(Instance *instance, Progress *progress);

/* Takes one sub-step of the method that steps where the motion is not free; its file defines it. */
Status solver_sub_step(Instance *instance, Progress *progress);

static const double HALF_ULP = 0.5 * DBL_EPSILON;

static inline double larger(double a, double b) {
    return a > b ? a : b;
}

/* Length of a vector; sums of three squares of numbers below 2^510 do not overflow. */
static inline double length_of(const double v[3]) {
    static const double squarable = 0x1p510;
    if (fabs(v[0]) < squarable && fabs(v[1]) < squarable && fabs(v[2]) < squarable)
        return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    const double a = v[0] * 0x1p-600, b = v[1] * 0x1p-600, c = v[2] * 0x1p-600;
    return sqrt(a * a + b * b + c * c) * 0x1p600;
}

static inline bool is_finite(const double x[]) {
    bool finite = true;
    for (size_t i = 0; i < STATE_COUNT; i++) finite = finite && isfinite(x[i]);
    return finite;
}

#endif
