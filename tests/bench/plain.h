/* What the timings are compared with: a plain RK4 step of attitude and rate, as one would write it by hand. */
#ifndef PLAIN_H
#define PLAIN_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

/* Time of the processor [s]: others on it count for less than on a clock. */
static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* With a full tensor and its inverse. */
typedef struct {
    double J[6], inverse[6], torque[3];
} Plain;

static void times(const double s[6], const double v[3], double out[3]) {
    out[0] = s[0] * v[0] + s[3] * v[1] + s[4] * v[2];
    out[1] = s[3] * v[0] + s[1] * v[1] + s[5] * v[2];
    out[2] = s[4] * v[0] + s[5] * v[1] + s[2] * v[2];
}

static void plain_rate(const Plain *b, const double x[7], double dx[7]) {
    const double *w = x + 4;
    double L[3], right[3];
    times(b->J, w, L);
    right[0] = b->torque[0] - (w[1] * L[2] - w[2] * L[1]);
    right[1] = b->torque[1] - (w[2] * L[0] - w[0] * L[2]);
    right[2] = b->torque[2] - (w[0] * L[1] - w[1] * L[0]);
    times(b->inverse, right, dx + 4);
    dx[0] = -0.5 * (x[1] * w[0] + x[2] * w[1] + x[3] * w[2]);
    dx[1] = 0.5 * (x[0] * w[0] + x[2] * w[2] - x[3] * w[1]);
    dx[2] = 0.5 * (x[0] * w[1] + x[3] * w[0] - x[1] * w[2]);
    dx[3] = 0.5 * (x[0] * w[2] + x[1] * w[1] - x[2] * w[0]);
}

static void plain_step(const Plain *b, double x[7], double h) {
    double k1[7], k2[7], k3[7], k4[7], y[7];
    plain_rate(b, x, k1);
    for (int i = 0; i < 7; i++) y[i] = x[i] + 0.5 * h * k1[i];
    plain_rate(b, y, k2);
    for (int i = 0; i < 7; i++) y[i] = x[i] + 0.5 * h * k2[i];
    plain_rate(b, y, k3);
    for (int i = 0; i < 7; i++) y[i] = x[i] + h * k3[i];
    plain_rate(b, y, k4);
    for (int i = 0; i < 7; i++) x[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
    const double scale = 1.0 / sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3]);
    for (int i = 0; i < 4; i++) x[i] *= scale;
}

static double time_plain(long steps, double *sink) {
    Plain b = {{2.0, 3.0, 4.0, 0.1, 0.2, 0.3}, {0.51, 0.34, 0.26, -0.02, -0.02, -0.02}, {0.0, 0.0, 0.0}};
    double x[7] = {1.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3};
    const double start = now();
    for (long i = 0; i < steps; i++) {
        b.torque[0] = 1e-9 * (double)i;
        plain_step(&b, x, 1e-3);
    }
    const double taken = now() - start;
    *sink += x[0] + x[4];
    return 1e9 * taken / (double)steps;
}

static int by_size(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double values[], size_t count) {
    qsort(values, count, sizeof values[0], by_size);
    return values[count / 2];
}

#endif
