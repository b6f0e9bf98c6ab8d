#include <stdbool.h>
#include <string.h>

#include "model.h"
#include "loop.h"

#if LOOP

#include "lane_kernels.h"

enum { POSE = 12, PORT = 9, SEEN = 9, MOST_ARGUMENTS = 10 };

/* Values, or small changes of or weights on them: everything between p and c. */
typedef struct {
    double pose[LOOP_FRAME_COUNT][POSE], seen[LOOP_BODY_COUNT][SEEN], mass[LOOP_BODY_COUNT];
    double sum[4], middle[3], inertia[6];
} Chain;

/* Sums are read and written in one place: each element of theirs follows from the same element before. */
typedef int Kernel(const double **arg, double **res, int *iw, double *w, int mem);

static Kernel *const SEE_FORWARD[] = {loop_fixed_forward, loop_scaled_forward, loop_free_forward, loop_diagonal_forward,
        loop_own_fixed_forward, loop_own_scaled_forward, loop_own_free_forward};
static Kernel *const SEE_REVERSE[] = {loop_fixed_reverse, loop_scaled_reverse, loop_free_reverse, loop_diagonal_reverse,
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

/* Places frames in axes that stand already, all in the same way.
   step : poses in those of the vessels that they hang on
   to   : where their poses go */
static void hang(const double p[], const Chain *now, const LoopFrame *const f[LANES], const Lanes step[POSE],
                 double *const to[LANES]) {
    const double *outer[LANES], *inside[LANES];
    Lanes pose[POSE], held[POSE], turned[POSE], placed[POSE];
    for (size_t k = 0; k < LANES; k++) {
        outer[k] = now->pose[f[k]->parent];
        inside[k] = value(p, f[k]->inside);
    }
    if (f[0]->kind == FRAME_INSIDE) {
        lanes_gather(held, inside, POSE);
        lanes_then((const Lanes *const[]){held, step}, turned);
        step = turned;
    }
    lanes_gather(pose, outer, POSE);
    lanes_then((const Lanes *const[]){pose, step}, placed);
    lanes_scatter(to, placed, POSE);
}

static void hang_one(const double p[], Chain *now, size_t frame, const Lanes steps[POSE], size_t lane) {
    const LoopFrame *f[LANES];
    double *to[LANES];
    Lanes step[POSE];
    for (size_t k = 0; k < LANES; k++) {
        f[k] = &LOOP_FRAMES[frame];
        to[k] = now->pose[frame];
    }
    for (size_t i = 0; i < POSE; i++) step[i] = lanes_all(lane_of(steps[i], lane));
    hang(p, now, f, step, to);
}

static void place_frames(const double p[], Chain *now) {
    memset(now->pose[0], 0, sizeof now->pose[0]);
    for (size_t i = 0; i < 9; i += 4) now->pose[0][i] = 1.0;
    for (size_t i = 1; i < LOOP_FRAME_COUNT; i += LANES) {
        const size_t count = i + LANES <= LOOP_FRAME_COUNT ? LANES : 1;
        const LoopFrame *f[LANES];
        const double *parent_port[LANES], *child_port[LANES];
        double *to[LANES];
        Lanes parent[PORT], child[PORT], step[POSE];
        bool together = true;
        for (size_t k = 0; k < LANES; k++) {
            const size_t frame = k < count ? i + k : i;
            f[k] = &LOOP_FRAMES[frame];
            to[k] = now->pose[frame];
            parent_port[k] = value(p, f[k]->parent_port);
            child_port[k] = value(p, f[k]->child_port);
            together = together && (size_t)f[k]->parent < i && f[k]->kind == f[0]->kind;
        }
        lanes_gather(parent, parent_port, PORT);
        lanes_gather(child, child_port, PORT);
        lanes_mated((const Lanes *const[]){parent, child}, step);
        if (together) {
            hang(p, now, f, step, to);
        } else {
            for (size_t k = 0; k < count; k++) hang_one(p, now, i + k, step, k);
        }
    }
}

static void take_poses(Lanes to[POSE], const Chain *now, const LoopBody *const b[LANES]) {
    const double *from[LANES];
    for (size_t k = 0; k < LANES; k++) from[k] = now->pose[b[k]->frame];
    lanes_gather(to, from, POSE);
}

static void take_held(Lanes to[], const double p[], const LoopBody *const b[LANES], size_t count) {
    const double *from[LANES];
    for (size_t k = 0; k < LANES; k++) from[k] = value(p, b[k]->held);
    lanes_gather(to, from, count);
}

static void take_moments(Lanes to[3], const double p[], const LoopBody *const b[LANES]) {
    const double *from[LANES];
    for (size_t k = 0; k < LANES; k++) from[k] = value(p, b[k]->moments);
    lanes_gather(to, from, 3);
}

/* Sees bodies of one kind from the root's axes. */
static void see(const double p[], const Chain *now, const LoopBody *const b[LANES], const Lanes *mass, Lanes seen[SEEN]) {
    Lanes pose[POSE], held[POSE], moments[3];
    const Lanes *const arg[] = {pose, mass, held, moments};
    switch (b[0]->kind) {
        case BODY_FIXED:
            take_poses(pose, now, b);
            take_held(held, p, b, SEEN);
            lanes_fixed(arg, seen);
            break;
        case BODY_SCALED:
            take_poses(pose, now, b);
            take_held(held, p, b, SEEN);
            lanes_scaled(arg, seen);
            break;
        case BODY_FREE:
            take_poses(pose, now, b);
            take_held(held, p, b, POSE);
            take_moments(moments, p, b);
            lanes_free(arg, seen);
            break;
        case BODY_DIAGONAL:
            take_poses(pose, now, b);
            take_moments(moments, p, b);
            lanes_diagonal(arg, seen);
            break;
        case BODY_OWN_FIXED:
            take_held(held, p, b, SEEN);
            lanes_own_fixed(arg, seen);
            break;
        case BODY_OWN_SCALED:
            take_held(held, p, b, SEEN);
            lanes_own_scaled(arg, seen);
            break;
        case BODY_OWN_FREE:
        default:
            take_held(held, p, b, POSE);
            take_moments(moments, p, b);
            lanes_own_free(arg, seen);
            break;
    }
}

/* Takes as many bodies as there are lanes: the tables have as many of a kind together. */
static void take_bodies(const LoopBody *b[LANES], size_t first) {
    for (size_t k = 0; k < LANES; k++) b[k] = &LOOP_BODIES[first + k];
}

static Lanes masses_of(const double p[], const LoopBody *const b[LANES]) {
    double mass[LANES];
    for (size_t k = 0; k < LANES; k++) mass[k] = *value(p, b[k]->mass);
    return lanes_of(mass);
}

/* Sums masses and first moments about the first body's centre. */
static void sum_masses(const double p[], Chain *now) {
    double sum[4] = {0.0, 0.0, 0.0, 0.0};
    Lanes first[3];
    for (size_t j = 0; j < LOOP_BODY_COUNT; j += LANES) {
        const LoopBody *b[LANES];
        take_bodies(b, j);
        const Lanes mass = masses_of(p, b);
        Lanes seen[SEEN], lever[3];
        double *to[LANES];
        see(p, now, b, &mass, seen);
        for (size_t k = 0; k < LANES; k++) to[k] = now->seen[j + k];
        lanes_scatter(to, seen, SEEN);
        memcpy(&now->mass[j], &mass, sizeof mass);
        for (size_t i = 0; i < 3 && j == 0; i++) first[i] = lanes_all(lane_of(seen[i], 0));
        lanes_lever((const Lanes *const[]){&mass, seen, first}, lever);
        for (size_t k = 0; k < LANES; k++) {
            sum[0] += lane_of(mass, k);
            for (size_t i = 0; i < 3; i++) sum[i + 1] += lane_of(lever[i], k);
        }
    }
    memcpy(now->sum, sum, sizeof sum);
}

/* Sums inertia about the common centre. */
static void sum_inertia(Chain *now) {
    double inertia[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    Lanes first[3], middle[3];
    for (size_t i = 0; i < 3; i++) {
        first[i] = lanes_all(now->seen[0][i]);
        middle[i] = lanes_all(now->middle[i]);
    }
    for (size_t j = 0; j < LOOP_BODY_COUNT; j += LANES) {
        const Lanes mass = lanes_of(&now->mass[j]);
        const double *seen[LANES];
        Lanes centre[3], own[6];
        for (size_t k = 0; k < LANES; k++) seen[k] = now->seen[j + k];
        lanes_gather(centre, seen, 3);
        lanes_spread((const Lanes *const[]){&mass, centre, first, middle}, own);
        for (size_t k = 0; k < LANES; k++)
            for (size_t i = 0; i < 6; i++) inertia[i] = inertia[i] + seen[k][i + 3] + lane_of(own[i], k);
    }
    memcpy(now->inertia, inertia, sizeof inertia);
}

static void put_together(const double p[], Chain *now, double *w) {
    place_frames(p, now);
    sum_masses(p, now);
    const double *sum[] = {now->sum};
    double *middle[] = {now->middle};
    loop_middle(sum, middle, NULL, w, 0);
    sum_inertia(now);
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
