/* Taylor series of gravity's gradient, of a body that turns as it goes about the attracting centre: by loops, what
   supervessel/rotation/propagators/gradient_series.py unrolls for the twin. Part of taylor_series.c alone.

   Position and velocity are followed in the axes of the law's map, in units of the distance at the start: x and y. With
   q = x . x and m = mu/distance^3, x' = y - omega x x and y' = -m q^(-3/2) x - omega x y; the acceleration of the body is
   3 m q^(-5/2) times a linear map of the products of two components of x. */
#ifndef GRADIENT_SERIES_H
#define GRADIENT_SERIES_H

#include <math.h>
#include <string.h>

#include "taylor_series.h"

/* One coefficient of all series.
   pull, twist : of q^(-3/2) and q^(-5/2)
   drive       : of the map of products of x */
typedef struct {
    double x[3], y[3], q, pull, twist, drive[3];
} Coefficient;

/* What sums of products take of a coefficient; at LANE_... stands what the product is of. */
enum {
    LANE_SQUARES = 0, LANE_MIXED = 3, LANE_PULL = 6, LANE_TWIST = 8, LANE_FALL = 10, LANE_DRIVE = 13, LANE_TURN_X = 16,
    LANE_TURN_Y = 22, LANES = 28,
    LANES_AT_ONCE = 14 /* as many as fit into the registers of a vector unit of the smallest kind */
};

typedef struct {
    double of[LANES];
} GradientRow;

/* The first coefficients and the rows of those between the first and the latest. */
typedef struct {
    Coefficient first;
    GradientRow ones[TAYLOR_MOST_ORDER], others[TAYLOR_MOST_ORDER];
    double push, pull; /* 3 m and m, times the step */
    const double *map; /* of products to the acceleration: three numbers, or three rows of six, column by column */
} Gradient;

/* sums: of products, lane by lane, of rows from `one` on and rows from `other` back. */
static void add_lanes(const GradientRow *one, const GradientRow *other, int count, double sums[LANES]) {
    for (int lane = 0; lane < LANES; lane += LANES_AT_ONCE) {
        double s[LANES_AT_ONCE] = {0.0};
        for (int j = 0; j < count; j++)
            for (int i = 0; i < LANES_AT_ONCE; i++) s[i] += one[j].of[lane + i] * other[-j].of[lane + i];
        memcpy(sums + lane, s, sizeof s);
    }
}

/* Fills the rows of coefficient k. */
static void spread_lanes(const Coefficient *c, const double rate[3], int k, double one[LANES], double other[LANES]) {
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, l = (i + 2) % 3;
        one[LANE_SQUARES + i] = other[LANE_SQUARES + i] = c->x[i];
        one[LANE_MIXED + i] = c->x[j];
        other[LANE_MIXED + i] = c->x[l];
        one[LANE_FALL + i] = c->pull;
        other[LANE_FALL + i] = c->x[i];
        one[LANE_DRIVE + i] = c->twist;
        other[LANE_DRIVE + i] = c->drive[i];
        one[LANE_TURN_X + i] = one[LANE_TURN_Y + i] = rate[j];
        one[LANE_TURN_X + 3 + i] = one[LANE_TURN_Y + 3 + i] = rate[l];
        other[LANE_TURN_X + i] = c->x[l];
        other[LANE_TURN_X + 3 + i] = c->x[j];
        other[LANE_TURN_Y + i] = c->y[l];
        other[LANE_TURN_Y + 3 + i] = c->y[j];
    }
    one[LANE_PULL] = one[LANE_TWIST] = c->q;
    one[LANE_PULL + 1] = one[LANE_TWIST + 1] = k * c->q;
    other[LANE_PULL] = other[LANE_PULL + 1] = c->pull;
    other[LANE_TWIST] = other[LANE_TWIST + 1] = c->twist;
}

/* Coefficient k of q^a, from two sums of products: of q_j and j q_j with the power's, j from 1 to k - 1. */
static double power_next(const double sums[2], double a, int k, double q, double first_q, double first_power) {
    return (((a + 1.0) * sums[1] - k * sums[0]) + a * k * q * first_power) / (k * first_q);
}

/* The map's image of the products of x: mixed ones first. */
static void drive_by(const double map[], const double mixed[3], const double squares[3], double drive[3]) {
    for (int i = 0; i < 3; i++) {
        if (GRADIENT_COUNT == 3) {
            drive[i] = map[i] * mixed[i];
        } else {
            double sum = 0.0;
            for (int j = 0; j < 3; j++) sum += map[3 * j + i] * mixed[j] + map[9 + 3 * j + i] * squares[j];
            drive[i] = sum;
        }
    }
}

/* What follows from x of coefficient k, sums being those of coefficients from 1 to k - 1. */
static void complete(const Gradient *g, const double sums[LANES], int k, Coefficient *c) {
    const Coefficient *first = &g->first;
    double squares[3], mixed[3];
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, l = (i + 2) % 3;
        squares[i] = sums[LANE_SQUARES + i] + 2.0 * (first->x[i] * c->x[i]);
        mixed[i] = sums[LANE_MIXED + i] + (first->x[j] * c->x[l] + c->x[j] * first->x[l]);
    }
    c->q = squares[0] + squares[1] + squares[2];
    c->pull = power_next(sums + LANE_PULL, -1.5, k, c->q, first->q, first->pull);
    c->twist = power_next(sums + LANE_TWIST, -2.5, k, c->q, first->q, first->twist);
    drive_by(g->map, mixed, squares, c->drive);
}

/* Component i of the latest coefficient of omega x vector, from sums at its lanes. */
static double turned(const double sums[6], int i, const double w[3], const double v[3], const double first[3],
                     const double last[3]) {
    const int j = (i + 1) % 3, l = (i + 2) % 3;
    const double plus = sums[i] + (w[j] * last[l] + v[j] * first[l]);
    const double minus = sums[3 + i] + (w[l] * last[j] + v[l] * first[j]);
    return plus - minus;
}

/* From coefficient k of all series, w being the first and v the latest of the rates: coefficient k + 1 of x and y, and
   the acceleration times the step. */
static void go_along(const Gradient *g, const double sums[LANES], int k, const double w[3], const double v[3],
                     const Coefficient *c, double step, double x[3], double y[3], double acceleration[3]) {
    const Coefficient *first = &g->first;
    const double scale = 1.0 / (k + 1);
    for (int i = 0; i < 3; i++) {
        double fall, push, turned_x, turned_y;
        if (k == 0) {
            const int j = (i + 1) % 3, l = (i + 2) % 3;
            fall = c->pull * c->x[i];
            push = c->twist * c->drive[i];
            turned_x = w[j] * c->x[l] - w[l] * c->x[j];
            turned_y = w[j] * c->y[l] - w[l] * c->y[j];
        } else {
            fall = sums[LANE_FALL + i] + (first->pull * c->x[i] + c->pull * first->x[i]);
            push = sums[LANE_DRIVE + i] + (first->twist * c->drive[i] + c->twist * first->drive[i]);
            turned_x = turned(sums + LANE_TURN_X, i, w, v, first->x, c->x);
            turned_y = turned(sums + LANE_TURN_Y, i, w, v, first->y, c->y);
        }
        x[i] = scale * (step * (c->y[i] - turned_x));
        y[i] = scale * (-g->pull * fall - step * turned_y);
        acceleration[i] = g->push * push;
    }
}

/* A vector of inertial axes in body axes, and back; q is of unit length. */
static void into_body(const double q[4], const double v[3], double out[3]) {
    const double along = q[1] * v[0] + q[2] * v[1] + q[3] * v[2];
    const double same = q[0] * q[0] - (q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    const double across[3] = {q[2] * v[2] - q[3] * v[1], q[3] * v[0] - q[1] * v[2], q[1] * v[1] - q[2] * v[0]};
    for (int i = 0; i < 3; i++) out[i] = same * v[i] + 2.0 * (along * q[1 + i] - q[0] * across[i]);
}

static void into_inertial(const double q[4], const double v[3], double out[3]) {
    const double back[4] = {-q[0], q[1], q[2], q[3]};
    into_body(back, v, out);
}

/* The first coefficients, of x and y in the axes of the map. */
static void begin_gradient(Gradient *g, const double x[3], const double y[3], double distance, double step,
                           const double map[]) {
    const double mu = GRAVITY_MU;
    g->pull = step * ((mu / (distance * distance)) / distance);
    g->push = 3.0 * g->pull;
    g->map = map;
    Coefficient *c = &g->first;
    double mixed[3], squares[3];
    for (int i = 0; i < 3; i++) {
        c->x[i] = x[i];
        c->y[i] = y[i];
        squares[i] = x[i] * x[i];
        mixed[i] = x[(i + 1) % 3] * x[(i + 2) % 3];
    }
    c->q = squares[0] + squares[1] + squares[2];
    const double root = sqrt(c->q);
    c->pull = 1.0 / (c->q * root);
    c->twist = 1.0 / (c->q * c->q * root);
    drive_by(map, mixed, squares, c->drive);
}

#endif
