/* The arithmetic of taylor_series.h, and nothing of the FMU: it needs no instance and keeps nothing. */
#include "taylor_series.h"

#include <math.h>
#include <stddef.h>

#if FIELD
#include "gradient_series.h"
#endif

/* Whether the law has products of rates, and whether their map has axes of its own. */
enum { GYROSCOPIC = PRODUCT_COUNT > 0, TURNED = PRODUCT_COUNT > 3 };

enum { WIDTH = GYROSCOPIC ? 10 : 7 };

/* What the products take of a coefficient: seven of the turn or the rates, see _turn in
   supervessel/rotation/propagators/taylor.py, then the rates, in an order that lets compilers take all by twos. */
typedef struct {
    double of[WIDTH];
} Row;

static double remainder_of(double before, double after) {
    return after / sqrt(before > 0.0 ? before : 1.0);
}

/* sums: of products, element by element, of rows from `one` on and rows from `other` back. */
static void add_products(const Row *one, const Row *other, int count, double sums[WIDTH]) {
    double s[WIDTH] = {0.0};
    for (int j = 0; j < count; j++)
        for (int i = 0; i < WIDTH; i++) s[i] += one[j].of[i] * other[-j].of[i];
    for (int i = 0; i < WIDTH; i++) sums[i] = s[i];
}

/* Between body axes and those of the map, whose own stand behind its first three numbers, column by column. */
static void from_body(const double map[], const double v[3], double out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] = TURNED ? map[3 + 3 * i] * v[0] + map[4 + 3 * i] * v[1] + map[5 + 3 * i] * v[2] : v[i];
}

static void to_body(const double map[], const double v[3], double out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] = TURNED ? map[3 + i] * v[0] + map[6 + i] * v[1] + map[9 + i] * v[2] : v[i];
}

/* Fills the rows of one coefficient. */
static void spread(const double turn[4], const double rate[3], double step, double one[WIDTH], double other[WIDTH]) {
    const double even = turn[0] + turn[2], odd = turn[1] + turn[3], p = turn[0] - turn[2], q = turn[1] - turn[3];
    one[0] = even + odd;
    one[1] = even - odd;
    one[2] = p + q;
    one[3] = p - q;
    one[4] = turn[3];
    one[5] = turn[1];
    one[6] = turn[2];
    const double eighth = 0.125 * step, y = eighth * rate[1];
    const double plus = eighth * rate[0] + eighth * rate[2], minus = eighth * rate[0] - eighth * rate[2];
    other[0] = plus + y;
    other[1] = y - plus;
    other[2] = minus - y;
    other[3] = -y - minus;
    other[4] = -step * rate[1];
    other[5] = -step * rate[2];
    other[6] = -step * rate[0];
    if (!GYROSCOPIC) return;
    one[8] = other[7] = rate[1];
    one[9] = other[8] = rate[2];
    one[7] = other[9] = rate[0];
}

static void estimate(Series *series) {
    double before[2] = {0.0, 0.0}, after[2] = {0.0, 0.0};
    for (int k = series->order - 3; k <= series->order; k++) {
        double *squares = k < series->order - 1 ? before : after;
        for (int i = 0; i < 4; i++) squares[0] += series->turn[k][i] * series->turn[k][i];
        for (int i = 0; i < 3; i++) squares[1] += series->rates[k][i] * series->rates[k][i];
    }
    series->error[0] = 2.0 * remainder_of(before[0], after[0]);
    series->error[1] = remainder_of(before[1], after[1]);
}

#ifdef AXES_RESPONSE

/* Adds to coefficient k + 1 of the rates the part of -w x S, the rates being known up to k. */
static void add_stored(int k, double step, Series *series) {
    const double *w = series->rates[k], *before = k > 0 ? series->rates[k - 1] : NULL;
    const double *S = series->stored[0], *gain = series->stored[1];
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, l = (i + 2) % 3;
        double turning = w[j] * S[l] - w[l] * S[j];
        if (before) turning += before[j] * gain[l] - before[l] * gain[j];
        series->rates[k + 1][i] -= step * series->response[i] * turning / (k + 1);
    }
}

static void begin_stored(const double map[], double step, Series *series) {
    double gain[3];
    for (int i = 0; i < 3; i++) gain[i] = step * series->held[3 + i];
    from_body(map, series->held, series->stored[0]);
    from_body(map, gain, series->stored[1]);
    add_stored(0, step, series);
}

#endif

#ifdef FLOW_COUNT

/* Adds to coefficient k + 1 of the rates the part of jet damping, the rates being known up to k. */
static void add_damped(int k, Series *series) {
    const double *w = series->rates[k];
    for (int i = 0; i < 3; i++) {
        const double *row = series->damped[i];
        series->rates[k + 1][i] -= (row[0] * w[0] + row[1] * w[1] + row[2] * w[2]) / (k + 1);
    }
}

static void begin_damped(const double map[], double step, Series *series) {
    double half[3][3]; /* half[j]: column j in the axes of the map */
    for (int j = 0; j < 3; j++) from_body(map, series->damping + 3 * j, half[j]);
    for (int i = 0; i < 3; i++) {
        const double row[3] = {step * half[0][i], step * half[1][i], step * half[2][i]};
        from_body(map, row, series->damped[i]);
    }
    add_damped(0, series);
}

#endif

#if FIELD

/* Begins the series of position and velocity, and adds the gradient's part to the first change of the rates. */
static void begin_field(const double x[7], const double map[], double step, Series *series, Gradient *g) {
    const double *r = series->field, distance = sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]), per = 1.0 / distance;
    double body[3], acceleration[3], scaled[3];
    for (int half = 0; half < 2; half++) {
        for (int i = 0; i < 3; i++) scaled[i] = per * r[3 * half + i];
        into_body(x, scaled, body);
        from_body(map, body, half ? series->motion[0] : series->place[0]);
    }
    series->distance = distance;
    begin_gradient(g, series->place[0], series->motion[0], distance, step, series->gradient);
    go_along(g, NULL, 0, series->rates[0], series->rates[0], &g->first, step, series->place[1], series->motion[1],
             acceleration);
    for (int i = 0; i < 3; i++) series->rates[1][i] += acceleration[i];
}

/* From coefficient k of all series: coefficient k + 1 of position and velocity, and what it adds to that of the rates. */
static void follow_field(int k, double step, Series *series, Gradient *g) {
    Coefficient c;
    double sums[LANES], acceleration[3];
    for (int i = 0; i < 3; i++) {
        c.x[i] = series->place[k][i];
        c.y[i] = series->motion[k][i];
    }
    add_lanes(g->ones + 1, g->others + (k - 1), k - 1, sums);
    complete(g, sums, k, &c);
    go_along(g, sums, k, series->rates[0], series->rates[k], &c, step, series->place[k + 1], series->motion[k + 1],
             acceleration);
    for (int i = 0; i < 3; i++) series->rates[k + 1][i] += acceleration[i] / (k + 1);
    if (k + 1 < series->order) spread_lanes(&c, series->rates[k], k, g->ones[k].of, g->others[k].of);
}

#endif

void taylor_series(const double x[7], const double acceleration[3], const double map[], double step, Series *series) {
    Row ones[TAYLOR_MOST_ORDER], others[TAYLOR_MOST_ORDER];
    double w[3], push[3];
    from_body(map, x + 4, w);
    from_body(map, acceleration, push);
    const double half = 0.5 * step, X = half * w[0], Y = half * w[1], Z = half * w[2];
    const int order = series->order;
    double(*turn)[4] = series->turn, (*rates)[3] = series->rates;
    for (int i = 0; i < 3; i++) rates[0][i] = w[i];
    turn[0][0] = turn[0][1] = turn[0][2] = turn[0][3] = 0.0;
    turn[1][0] = 0.0;
    turn[1][1] = X;
    turn[1][2] = Y;
    turn[1][3] = Z;
    for (int i = 0; i < 3; i++) rates[1][i] = step * push[i];
    double pull[3] = {0.0, 0.0, 0.0};
    for (int i = 0; i < 3 && GYROSCOPIC; i++) {
        pull[i] = step * map[i];
        rates[1][i] = pull[i] * (w[(i + 1) % 3] * w[(i + 2) % 3]) + rates[1][i];
    }
#ifdef AXES_RESPONSE
    if (GYROSCOPIC) begin_stored(map, step, series);
#endif
#ifdef FLOW_COUNT
    begin_damped(map, step, series);
#endif
#if FIELD
    Gradient gradient;
    begin_field(x, map, step, series, &gradient);
#endif
    for (int k = 1; k < order; k++) {
        const double *p = turn[k], *v = rates[k], scale = 1.0 / (k + 1);
        double s[WIDTH];
        add_products(ones + 1, others + (k - 1), k - 1, s);
        const double even = s[0] + s[2], odd = s[1] + s[3], f = s[0] - s[2], g = s[1] - s[3];
        double *next = turn[k + 1], *rate = rates[k + 1];
        next[0] = scale * (-(even + odd) - ((p[1] * X + p[2] * Y) + p[3] * Z));
        next[1] = scale * ((((even - odd) + s[4]) + half * v[0]) + ((p[0] * X + p[2] * Z) - p[3] * Y));
        next[2] = scale * ((((f + g) + s[5]) + half * v[1]) + ((p[0] * Y + p[3] * X) - p[1] * Z));
        next[3] = scale * ((((f - g) + s[6]) + half * v[2]) + ((p[0] * Z + p[1] * Y) - p[2] * X));
        rate[0] = rate[1] = rate[2] = 0.0;
        if (GYROSCOPIC) {
            rate[0] = (scale * pull[0]) * (s[8] + (w[1] * v[2] + v[1] * w[2]));
            rate[1] = (scale * pull[1]) * (s[9] + (w[2] * v[0] + v[2] * w[0]));
            rate[2] = (scale * pull[2]) * (s[7] + (w[0] * v[1] + v[0] * w[1]));
        }
        if (k + 1 < order) spread(p, v, step, ones[k].of, others[k].of);
#ifdef AXES_RESPONSE
        if (GYROSCOPIC) add_stored(k, step, series);
#endif
#ifdef FLOW_COUNT
        add_damped(k, series);
#endif
#if FIELD
        follow_field(k, step, series, &gradient);
#endif
    }
    estimate(series);
}

void taylor_sum(const Series *series, const double x[7], const double map[], double share, double next[7],
                double rest[3]) {
    double turned[2][4] = {{0.0}}, gained[2][3] = {{0.0}}, axis[3], gain[3];
    const double square = share * share;
    for (int k = series->order; k > 0; k -= 2) { /* the smallest first */
        for (int i = 0; i < 4; i++) turned[0][i] = turned[0][i] * square + series->turn[k][i];
        for (int i = 0; i < 4; i++) turned[1][i] = turned[1][i] * square + series->turn[k - 1][i];
        for (int i = 0; i < 3; i++) gained[0][i] = gained[0][i] * square + series->rates[k][i];
        for (int i = 0; i < 3; i++) gained[1][i] = gained[1][i] * square + series->rates[k - 1][i];
    }
    for (int i = 0; i < 4; i++) turned[0][i] = turned[0][i] * square + turned[1][i] * share;
    for (int i = 0; i < 3; i++) gained[0][i] = gained[0][i] * square + gained[1][i] * share;
    to_body(map, turned[0] + 1, axis);
    to_body(map, gained[0], gain);
    const double a = turned[0][0], b = axis[0], c = axis[1], d = axis[2];
    const double q[4] = {
        x[0] + (x[0] * a - (x[1] * b + x[2] * c + x[3] * d)),
        x[1] + (x[0] * b + x[1] * a + (x[2] * d - x[3] * c)),
        x[2] + (x[0] * c + x[2] * a + (x[3] * b - x[1] * d)),
        x[3] + (x[0] * d + x[3] * a + (x[1] * c - x[2] * b)),
    };
    const double length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int i = 0; i < 4; i++) next[i] = q[i] / length;
    for (int i = 0; i < 3; i++) { /* Knuth's sum: next and rest together are exact */
        const double added = gain[i] + rest[i], sum = x[4 + i] + added, back = sum - x[4 + i];
        rest[i] = (x[4 + i] - (sum - back)) + (added - back);
        next[4 + i] = sum;
    }
}

#if FIELD
void taylor_sum_field(const Series *series, const double map[], double share, const double next[7], double field[6]) {
    const double(*const sums[2])[3] = {series->place, series->motion};
    for (int half = 0; half < 2; half++) {
        double total[3] = {0.0}, body[3], inertial[3];
        for (int k = series->order; k >= 0; k--)
            for (int i = 0; i < 3; i++) total[i] = total[i] * share + sums[half][k][i];
        to_body(map, total, body);
        into_inertial(next, body, inertial);
        for (int i = 0; i < 3; i++) field[3 * half + i] = series->distance * inertial[i];
    }
}
#endif
