/* A Taylor step by loops: what supervessel/propagators/taylor.py unrolls for the twin, operation by operation. Loops, because the unrolled code of order 12 and more is half as fast: it outgrows the
   instruction cache. */
#ifndef TAYLOR_H
#define TAYLOR_H

enum { TAYLOR_LEAST_ORDER = 8, TAYLOR_MOST_ORDER = 16 };

/* From x (attitude, angular velocity) by step [s] to next.
   acceleration : by the torque [rad/s2]
   map          : of the products of two rates to the acceleration without torque, column by column
   error        : estimates, attitude [rad] and angular velocity [rad/s]; they grow with step^(order + 1) */
void taylor_step(const double x[7], const double acceleration[3], const double map[], double step, int order,
                 double next[7], double error[2]);

#endif
