/* Taylor series by loops: what supervessel/rotation/propagators/taylor.py unrolls for the twin, operation by operation.
   Loops, because the unrolled code outgrows the instruction cache. */
#ifndef TAYLOR_SERIES_H
#define TAYLOR_SERIES_H

#include "scene.h"

/* The coefficients of s^0, s^1, and so on, s being (time since x)/step, in the axes of the map.
   turn  : of the turn since x, a quaternion, without its 1
   rates : of the angular velocity [rad/s]
   error : estimate of what the series leave out at s = 1: attitude [rad], angular velocity [rad/s]; like
           s^(order + 1)
   In a scene with wheels, where held and response are set before the series are found:
   held     : their momentum S at x [N m s] and its rate [N m], which is constant, both in body axes
   response : in the axes of the map, the acceleration by a torque over that torque [1/(kg m2)]
   stored   : S and its gain over the step, in the axes of the map
   With jet damping, where damping is set before the series are found:
   damping  : the matrix that takes the rate to the opposite of the acceleration by it [1/s], column by column, body axes
   damped   : the same times the step, in the axes of the map, row by row
   In a field of gravity, where field and gradient are set before the series are found:
   field            : position [m] and velocity [m/s] from the attracting centre at x, inertial axes
   gradient         : the map of products of the direction to the acceleration, in the axes of the map
   distance         : |r| at x [m]
   place, motion    : of position and velocity, in units of the distance */
typedef struct {
    double turn[TAYLOR_MOST_ORDER + 1][4], rates[TAYLOR_MOST_ORDER + 1][3], error[2];
    int order;
#ifdef AXES_RESPONSE
    const double *held, *response;
    double stored[2][3];
#endif
#ifdef FLOW_COUNT
    const double *damping;
    double damped[3][3];
#endif
#if FIELD
    const double *field, *gradient;
    double distance, place[TAYLOR_MOST_ORDER + 1][3], motion[TAYLOR_MOST_ORDER + 1][3];
#endif
} Series;

/* Finds the series, their order being set, from x (attitude, angular velocity).
   acceleration : by the torque [rad/s2], body axes
   map          : without torque the accelerations are its first three numbers times products of two rates, in the
                  body axes; or in those, column by column, that follow
   step         : [s] */
void taylor_series(const double x[7], const double acceleration[3], const double map[], double step, Series *series);

/* Sums the series up, at s = share, to the state next.
   rest : what rounding kept from the angular velocity before, and then keeps from it [rad/s]: over many sub-steps a
          nearly steady gain would be rounded to the same side */
void taylor_sum(const Series *series, const double x[7], const double map[], double share, double next[7],
                double rest[3]);

#if FIELD
/* Sums up position [m] and velocity [m/s] from the attracting centre at s = share, inertial axes; next is the state
   there. */
void taylor_sum_field(const Series *series, const double map[], double share, const double next[7], double field[6]);
#endif

#endif
