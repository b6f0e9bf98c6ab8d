#include "taylor.h"

#include <math.h>

#include "scene.h"

#if STEPS == STEPS_BY_SERIES

/* A coefficient (a, b, c, d) of the turn, as the products with (0, x, y, z) take it. */
typedef struct {
    double by_x[4], by_y[4], by_z[4];
} Turn;

static double remainder_of(double before, double after) {
    return after / sqrt(before > 0.0 ? before : 1.0);
}

#if PRODUCT_COUNT > 0

/* Coefficient k of the product of two rates; even and odd terms have a sum of their own. */
static double mixed_product(double (*rates)[3], int k, int first, int second) {
    double even = 0.0, odd = 0.0;
    int j = 0;
    for (; j < k; j += 2) {
        even += rates[j][first] * rates[k - j][second];
        odd += rates[j + 1][first] * rates[k - j - 1][second];
    }
    if (j == k) even += rates[j][first] * rates[0][second];
    return even + odd;
}

#endif

#if PRODUCT_COUNT > 3

/* Coefficient k of the square of a rate; its terms are added once and doubled. */
static double square_product(double (*rates)[3], int k, int i) {
    const int middle = (k + 1) / 2;
    double even = 0.0, odd = 0.0;
    int j = 0;
    for (; j + 1 < middle; j += 2) {
        even += rates[j][i] * rates[k - j][i];
        odd += rates[j + 1][i] * rates[k - j - 1][i];
    }
    if (j < middle) even += rates[j][i] * rates[k - j][i];
    const double twice = 2.0 * (even + odd);
    return k % 2 ? twice : twice + rates[middle][i] * rates[middle][i];
}

#endif

/* change: coefficient k of step times the acceleration, from the coefficients 0 .. k of the rates. */
static void gyroscopic(double (*rates)[3], int k, const double pull[], double change[3]) {
#if PRODUCT_COUNT == 0
    (void)rates, (void)k, (void)pull;
    change[0] = change[1] = change[2] = 0.0;
#else
    double products[PRODUCT_COUNT];
    for (int i = 0; i < 3; i++) products[i] = mixed_product(rates, k, (i + 1) % 3, (i + 2) % 3);
#if PRODUCT_COUNT == 3 /* of principal axes: the map is diagonal */
    for (int i = 0; i < 3; i++) change[i] = pull[4 * i] * products[i];
#else
    for (int i = 0; i < 3; i++) products[3 + i] = square_product(rates, k, i);
    for (int i = 0; i < 3; i++) {
        change[i] = pull[i] * products[0];
        for (int n = 1; n < PRODUCT_COUNT; n++) change[i] += pull[i + 3 * n] * products[n];
    }
#endif
#endif
}

void taylor_step(const double x[7], const double acceleration[3], const double map[], double step, int order,
                 double next[7], double error[2]) {
    Turn turns[TAYLOR_MOST_ORDER];
    double halves[TAYLOR_MOST_ORDER][3], rates[TAYLOR_MOST_ORDER + 1][3], turn[TAYLOR_MOST_ORDER][4];
    double pull[3 * PRODUCT_COUNT + 1];
    for (int i = 0; i < 3 * PRODUCT_COUNT; i++) pull[i] = step * map[i];
    for (int i = 0; i < 3; i++) rates[0][i] = x[4 + i];
    for (int k = 0; k < order; k++) {
        const double scale = 1.0 / (k + 1);
        double by_x[4] = {0.0, 0.0, 0.0, 0.0}, by_y[4] = {0.0, 0.0, 0.0, 0.0}, by_z[4] = {0.0, 0.0, 0.0, 0.0};
        for (int j = 0; j < k; j++) {
            const Turn *t = &turns[j];
            const double *half = halves[k - 1 - j];
            for (int i = 0; i < 4; i++) {
                by_x[i] += t->by_x[i] * half[0];
                by_y[i] += t->by_y[i] * half[1];
                by_z[i] += t->by_z[i] * half[2];
            }
        }
        double change[3];
        gyroscopic(rates, k, pull, change);
        for (int i = 0; i < 3; i++) {
            halves[k][i] = 0.5 * step * rates[k][i];
            if (k == 0) change[i] += step * acceleration[i];
            rates[k + 1][i] = scale * change[i];
        }
        const double last[4] = {0.0, halves[k][0], halves[k][1], halves[k][2]};
        for (int i = 0; i < 4; i++) turn[k][i] = scale * (((by_x[i] + by_y[i]) + by_z[i]) + last[i]);
        const double a = turn[k][0], b = turn[k][1], c = turn[k][2], d = turn[k][3];
        turns[k] = (Turn){{-b, a, d, -c}, {-c, -d, a, b}, {-d, c, -b, a}};
    }
    double turned[4] = {0.0, 0.0, 0.0, 0.0}, gained[3] = {0.0, 0.0, 0.0};
    for (int k = order - 1; k >= 0; k--) { /* the smallest first */
        for (int i = 0; i < 4; i++) turned[i] += turn[k][i];
        for (int i = 0; i < 3; i++) gained[i] += rates[k + 1][i];
    }
    const double a = turned[0], b = turned[1], c = turned[2], d = turned[3];
    const double q[4] = {
        x[0] + (x[0] * a - (x[1] * b + x[2] * c + x[3] * d)),
        x[1] + (x[0] * b + x[1] * a + (x[2] * d - x[3] * c)),
        x[2] + (x[0] * c + x[2] * a + (x[3] * b - x[1] * d)),
        x[3] + (x[0] * d + x[3] * a + (x[1] * c - x[2] * b)),
    };
    const double length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int i = 0; i < 4; i++) next[i] = q[i] / length;
    for (int i = 0; i < 3; i++) next[4 + i] = x[4 + i] + gained[i];
    double before[2] = {0.0, 0.0}, after[2] = {0.0, 0.0};
    for (int k = order - 4; k < order; k++) {
        double *squares = k < order - 2 ? before : after;
        for (int i = 0; i < 4; i++) squares[0] += turn[k][i] * turn[k][i];
        for (int i = 0; i < 3; i++) squares[1] += rates[k + 1][i] * rates[k + 1][i];
    }
    error[0] = 2.0 * remainder_of(before[0], after[0]);
    error[1] = remainder_of(before[1], after[1]);
}

#else

/* C99 wants something to compile. */
typedef int NoSeries;

#endif
