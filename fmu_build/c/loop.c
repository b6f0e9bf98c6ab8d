#include <string.h>

#include "model.h"
#include "loop.h"

#if LOOP

enum { POSE = 12, PORT = 9, SEEN = 9, MOST_ARGUMENTS = 10 };

/* Values, or small changes of or weights on them: everything between p and c. */
typedef struct {
    double pose[LOOP_FRAME_COUNT][POSE], seen[LOOP_BODY_COUNT][SEEN];
    double sum[4], middle[3], inertia[6];
} Chain;

/* Sums are read and written in one place: each element of theirs follows from the same element before. */
typedef int Kernel(const double **arg, double **res, int *iw, double *w, int mem);

static Kernel *const SEE[] = {loop_fixed, loop_scaled, loop_free,
        loop_own_fixed, loop_own_scaled, loop_own_free};
static Kernel *const SEE_FORWARD[] = {loop_fixed_forward, loop_scaled_forward, loop_free_forward,
        loop_own_fixed_forward, loop_own_scaled_forward, loop_own_free_forward};
static Kernel *const SEE_REVERSE[] = {loop_fixed_reverse, loop_scaled_reverse, loop_free_reverse,
        loop_own_fixed_reverse, loop_own_scaled_reverse, loop_own_free_reverse};

static const double NOTHING[POSE];

static const double *value(const double p[], int index) {
    return index >= 0 ? &p[index] : &LOOP_HELD[~index];
}

static const double *change(const double dp[], int index) {
    return index >= 0 ? &dp[index] : NOTHING;
}

static void add_to(double sum[], const double terms[], size_t count) {
    for (size_t i = 0; i < count; i++) sum[i] += terms[i];
}

/* Adds weights on an input; what is constant has none. */
static void add_weights(double wp[], int index, const double terms[], size_t count) {
    if (index >= 0) add_to(&wp[index], terms, count);
}

static void place_frames(const double p[], Chain *now, double *w) {
    memset(now->pose[0], 0, sizeof now->pose[0]);
    for (size_t i = 0; i < 9; i += 4) now->pose[0][i] = 1.0;
    for (size_t i = 1; i < LOOP_FRAME_COUNT; i++) {
        const LoopFrame *f = &LOOP_FRAMES[i];
        double *res[] = {now->pose[i]};
        if (f->kind == FRAME_INSIDE) {
            const double *arg[] = {now->pose[f->parent], value(p, f->inside), value(p, f->parent_port),
                                   value(p, f->child_port)};
            loop_hang_inside(arg, res, NULL, w, 0);
        } else {
            const double *arg[] = {now->pose[f->parent], value(p, f->parent_port), value(p, f->child_port)};
            loop_hang(arg, res, NULL, w, 0);
        }
    }
}

static void put_together(const double p[], Chain *now, double *w) {
    place_frames(p, now, w);
    memset(now->sum, 0, sizeof now->sum);
    memset(now->inertia, 0, sizeof now->inertia);
    for (size_t j = 0; j < LOOP_BODY_COUNT; j++) {
        const LoopBody *b = &LOOP_BODIES[j];
        const double *arg[] = {now->pose[b->frame], value(p, b->mass), value(p, b->held), value(p, b->moments)};
        double *res[] = {now->seen[j]};
        SEE[b->kind](arg, res, NULL, w, 0);
        const double *weighed[] = {now->sum, value(p, b->mass), now->seen[j], now->seen[0]};
        res[0] = now->sum;
        loop_weigh(weighed, res, NULL, w, 0);
    }
    const double *sum[] = {now->sum};
    double *middle_of[] = {now->middle};
    loop_middle(sum, middle_of, NULL, w, 0);
    for (size_t j = 0; j < LOOP_BODY_COUNT; j++) {
        const double *arg[] = {now->inertia, value(p, LOOP_BODIES[j].mass), now->seen[j], now->seen[0], now->middle};
        double *res[] = {now->inertia};
        loop_add(arg, res, NULL, w, 0);
    }
}

/* w: two chains, then what the kernels need. */
int composite(const double **arg, double **res, int *iw, double *w, int mem) {
    Chain *now = (Chain *)w;
    put_together(arg[0], now, w + LOOP_WORK);
    const double *whole[] = {now->sum, now->seen[0], now->middle, now->inertia};
    return loop_finish(whole, res, iw, w + LOOP_WORK, mem);
}

int composite_forward(const double **arg, double **res, int *iw, double *w, int mem) {
    const double *p = arg[0], *dp = arg[1];
    Chain *now = (Chain *)w, *d = now + 1;
    w += LOOP_WORK;
    put_together(p, now, w);
    memset(d, 0, sizeof *d);
    for (size_t i = 1; i < LOOP_FRAME_COUNT; i++) {
        const LoopFrame *f = &LOOP_FRAMES[i];
        double *to[] = {d->pose[i]};
        const double *pose = now->pose[f->parent], *dpose = d->pose[f->parent];
        const double *parent = value(p, f->parent_port), *child = value(p, f->child_port);
        const double *dparent = change(dp, f->parent_port), *dchild = change(dp, f->child_port);
        if (f->kind == FRAME_INSIDE) {
            const double *from[] = {pose, value(p, f->inside), parent, child, dpose, NOTHING, dparent, dchild};
            loop_hang_inside_forward(from, to, iw, w, mem);
        } else {
            const double *from[] = {pose, parent, child, dpose, dparent, dchild};
            loop_hang_forward(from, to, iw, w, mem);
        }
    }
    for (size_t j = 0; j < LOOP_BODY_COUNT; j++) {
        const LoopBody *b = &LOOP_BODIES[j];
        const double *mass = value(p, b->mass), *dmass = change(dp, b->mass);
        const double *from[] = {now->pose[b->frame], mass, value(p, b->held), value(p, b->moments),
                                d->pose[b->frame], dmass, NOTHING, change(dp, b->moments)};
        double *to[] = {d->seen[j]};
        SEE_FORWARD[b->kind](from, to, iw, w, mem);
        const double *weighed[] = {now->sum, mass, now->seen[j], now->seen[0], d->sum, dmass, d->seen[j], d->seen[0]};
        to[0] = d->sum;
        loop_weigh_forward(weighed, to, iw, w, mem);
    }
    const double *sum[] = {now->sum, d->sum};
    double *middle_of[] = {d->middle};
    loop_middle_forward(sum, middle_of, iw, w, mem);
    for (size_t j = 0; j < LOOP_BODY_COUNT; j++) {
        const int mass = LOOP_BODIES[j].mass;
        const double *from[] = {now->inertia, value(p, mass), now->seen[j], now->seen[0], now->middle,
                                d->inertia, change(dp, mass), d->seen[j], d->seen[0], d->middle};
        double *to[] = {d->inertia};
        loop_add_forward(from, to, iw, w, mem);
    }
    const double *whole[] = {now->sum, now->seen[0], now->middle, now->inertia,
                             d->sum, d->seen[0], d->middle, d->inertia};
    return loop_finish_forward(whole, res, iw, w, mem);
}

/* Weights on bodies to those on their frames and on p. */
static void bodies_reverse(const double p[], const Chain *now, Chain *v, double wp[], double *w) {
    for (size_t j = 0; j < LOOP_BODY_COUNT; j++) {
        const LoopBody *b = &LOOP_BODIES[j];
        double pose[POSE], mass[1], held[POSE], moments[3];
        const double *from[] = {now->pose[b->frame], value(p, b->mass), value(p, b->held), value(p, b->moments),
                                v->seen[j]};
        double *to[] = {pose, mass, held, moments};
        SEE_REVERSE[b->kind](from, to, NULL, w, 0);
        add_to(v->pose[b->frame], pose, POSE);
        add_weights(wp, b->mass, mass, 1);
        add_weights(wp, b->moments, moments, 3);
    }
}

static void frames_reverse(const double p[], const Chain *now, Chain *v, double wp[], double *w) {
    for (size_t i = LOOP_FRAME_COUNT - 1; i > 0; i--) {
        const LoopFrame *f = &LOOP_FRAMES[i];
        double pose[POSE], inside[POSE], parent[PORT], child[PORT];
        const double *parent_port = value(p, f->parent_port), *child_port = value(p, f->child_port);
        if (f->kind == FRAME_INSIDE) {
            const double *from[] = {now->pose[f->parent], value(p, f->inside), parent_port, child_port, v->pose[i]};
            double *to[] = {pose, inside, parent, child};
            loop_hang_inside_reverse(from, to, NULL, w, 0);
        } else {
            const double *from[] = {now->pose[f->parent], parent_port, child_port, v->pose[i]};
            double *to[] = {pose, parent, child};
            loop_hang_reverse(from, to, NULL, w, 0);
        }
        add_to(v->pose[f->parent], pose, POSE);
        add_weights(wp, f->parent_port, parent, PORT);
        add_weights(wp, f->child_port, child, PORT);
    }
}

int composite_reverse(const double **arg, double **res, int *iw, double *w, int mem) {
    const double *p = arg[0];
    double *wp = res[0];
    Chain *now = (Chain *)w, *v = now + 1;
    w += LOOP_WORK;
    put_together(p, now, w);
    memset(v, 0, sizeof *v);
    memset(wp, 0, INPUT_P_COUNT * sizeof(double));
    const double *whole[] = {now->sum, now->seen[0], now->middle, now->inertia, arg[1]};
    double first[3], part[3], sum[4], inertia[6], mass[1], seen[SEEN];
    double *of_whole[] = {v->sum, first, v->middle, v->inertia};
    loop_finish_reverse(whole, of_whole, iw, w, mem);
    for (size_t j = 0; j < LOOP_BODY_COUNT; j++) {
        const int index = LOOP_BODIES[j].mass;
        const double *from[] = {now->inertia, value(p, index), now->seen[j], now->seen[0], now->middle, v->inertia};
        double of_middle[3];
        double *to[] = {inertia, mass, seen, part, of_middle};
        loop_add_reverse(from, to, iw, w, mem);
        add_weights(wp, index, mass, 1);
        add_to(v->seen[j], seen, SEEN);
        add_to(first, part, 3);
        add_to(v->middle, of_middle, 3);
    }
    const double *of_middle[] = {now->sum, v->middle};
    double *on_sum[] = {sum};
    loop_middle_reverse(of_middle, on_sum, iw, w, mem);
    add_to(v->sum, sum, 4);
    for (size_t j = 0; j < LOOP_BODY_COUNT; j++) {
        const int index = LOOP_BODIES[j].mass;
        const double *from[] = {now->sum, value(p, index), now->seen[j], now->seen[0], v->sum};
        double *to[] = {sum, mass, seen, part};
        loop_weigh_reverse(from, to, iw, w, mem);
        add_weights(wp, index, mass, 1);
        add_to(v->seen[j], seen, SEEN);
        add_to(first, part, 3);
    }
    add_to(v->seen[0], first, 3);
    bodies_reverse(p, now, v, wp, w);
    frames_reverse(p, now, v, wp, w);
    return 0;
}

#endif
