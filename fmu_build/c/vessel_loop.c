/* The composite of a scene of many moving vessels, and its derivatives, by a loop over tables: in place of the model's
   functions of these names, which straight code for so many vessels would make long and slow.

   Keeps nothing: what a call needs lies in the work array that it is given. Needs the tables of vessel_loop.h and the
   loop's steps, generated for one vessel (model.c) and for several at once (lane_kernels.h). */
#include "vessel_loop.h"

#include <stdbool.h>
#include <string.h>

#include "lane_kernels.h"
#include "model.h"

enum { POSE = LOOP_POSE, PORT = LOOP_PORT, SEEN = LOOP_SEEN, BLOCK = LOOP_BLOCK };

/* The quantities of supervessel/composite/chain.py, in its layout. Poses of groups, and bodies in root axes, stand in
   blocks of BLOCK side by side, as in the tables; the pose of the root's own group is the last of the first block. */
typedef struct {
    double pose[(LOOP_FRAME_COUNT + 2 * BLOCK - 2) / BLOCK * BLOCK * POSE];
    double seen[LOOP_BODY_COUNT * SEEN], mass[LOOP_BODY_COUNT], first[3];
    double sum[4], middle[3], inertia[6];
} Chain;

/* Small changes of the quantities of a Chain, or weights on them; bodies and poses one after the other. */
typedef struct {
    double pose[LOOP_FRAME_COUNT][POSE], seen[LOOP_BODY_COUNT][SEEN];
    double sum[4], middle[3], inertia[6];
} ChainVariation;

typedef char WorkHoldsBoth[sizeof(Chain) + sizeof(ChainVariation) <= LOOP_WORK * sizeof(double) ? 1 : -1];

/* A generated step. A sum is argument and result in the same array: each new element depends on no other old one. */
typedef int Kernel(const double **arg, double **res, int *iw, double *w, int mem);

static Kernel *const SEE_FORWARD[] = {loop_fixed_forward, loop_scaled_forward, loop_free_forward,
        loop_diagonal_forward, loop_diagonal_forward,
        loop_own_fixed_forward, loop_own_scaled_forward, loop_own_free_forward};
static Kernel *const SEE_REVERSE[] = {loop_fixed_reverse, loop_scaled_reverse, loop_free_reverse,
        loop_diagonal_reverse, loop_diagonal_reverse,
        loop_own_fixed_reverse, loop_own_scaled_reverse, loop_own_free_reverse};

/* How many constants a body has: centre and inertia, a pose, or moments. */
static const size_t HELD_COUNT[] = {SEEN, SEEN, POSE, 3, 0, SEEN, SEEN, POSE};

static const double NOTHING[POSE];

/* The arrays that a LoopPlace points into, by its `held`: p and LOOP_HELD. */
typedef const double *const Sources[2];

LANES_INLINE const double *value(const Sources from, LoopPlace place) {
    return &from[place.held][place.at];
}

static const double *change(const double dp[], LoopPlace place) {
    return place.held ? NOTHING : &dp[place.at];
}

static void add_to(double sum[], const double terms[], size_t count) {
    for (size_t i = 0; i < count; i++) sum[i] += terms[i];
}

/* Adds weights on an input; what is constant has none. */
static void add_weights(double wp[], LoopPlace place, const double terms[], size_t count) {
    if (!place.held) add_to(&wp[place.at], terms, count);
}

/* The index in Chain.pose of a frame's pose, and back from that index the frame. */
static size_t pose_at(size_t frame) {
    const size_t place = frame + BLOCK - 1;
    return place / BLOCK * BLOCK * POSE + place % BLOCK;
}
static size_t frame_at(int pose) {
    return (size_t)pose / (BLOCK * POSE) * BLOCK + (size_t)pose % BLOCK - (BLOCK - 1);
}

/* The index in Chain.seen of a body's first number. */
static size_t seen_at(size_t body) {
    return body / BLOCK * BLOCK * SEEN + body % BLOCK;
}

/* Copies the numbers of one pose or body out of a block, where they stand BLOCK apart. */
static const double *take(double to[], const double from[], size_t count) {
    for (size_t i = 0; i < count; i++) to[i] = from[i * BLOCK];
    return to;
}

/* Poses of LANES frames from those of the groups that they hang on, which are known. inside: whether the frames are of
   kind FRAME_INSIDE; all of them must be, or none. */
LANES_INLINE void place_groups(const Sources sources, const Chain *now, const LoopFrame *const f[LANES], bool inside,
                               Lanes placed[POSE]) {
    const double *outer[LANES], *parent_port[LANES], *child_port[LANES], *held[LANES];
    Lanes parent[PORT], child[PORT], step[POSE], pose[POSE], within[POSE], turned[POSE];
    for (size_t k = 0; k < LANES; k++) {
        parent_port[k] = value(sources, f[k]->parent_port);
        child_port[k] = value(sources, f[k]->child_port);
        outer[k] = &now->pose[f[k]->parent];
        held[k] = &LOOP_HELD[f[k]->inside];
    }
    lanes_gather(parent, parent_port, 1, PORT);
    lanes_gather(child, child_port, 1, PORT);
    lanes_mated((const Lanes *const[]){parent, child}, step);
    if (inside) {
        lanes_gather(within, held, 1, POSE);
        lanes_then((const Lanes *const[]){within, step}, turned);
    }
    lanes_gather(pose, outer, BLOCK, POSE);
    lanes_then((const Lanes *const[]){pose, inside ? turned : step}, placed);
}

/* Places one frame alone, where frames side by side are not of one kind or one of them hangs on another. */
static void place_one(const Sources sources, Chain *now, size_t frame) {
    const LoopFrame *f[LANES];
    Lanes placed[POSE];
    for (size_t k = 0; k < LANES; k++) f[k] = &LOOP_FRAMES[frame];
    if (f[0]->kind == FRAME_INSIDE)
        place_groups(sources, now, f, true, placed);
    else
        place_groups(sources, now, f, false, placed);
    for (size_t i = 0; i < POSE; i++) now->pose[pose_at(frame) + i * BLOCK] = lane_of(placed[i], 0);
}

static void place_frames(const Sources sources, Chain *now) {
    for (size_t i = 0; i < POSE; i++) now->pose[pose_at(0) + i * BLOCK] = i < 9 && i % 4 == 0 ? 1.0 : 0.0;
    for (size_t i = 1; i < LOOP_FRAME_COUNT; i += LANES) {
        const LoopFrame *f[LANES];
        Lanes placed[POSE];
        bool together = i + LANES <= LOOP_FRAME_COUNT;
        for (size_t k = 0; k < LANES && together; k++) {
            f[k] = &LOOP_FRAMES[i + k];
            together = (size_t)f[k]->parent < pose_at(i) && f[k]->kind == f[0]->kind;
        }
        if (!together) {
            for (size_t k = i; k < i + LANES && k < LOOP_FRAME_COUNT; k++) place_one(sources, now, k);
            continue;
        }
        if (f[0]->kind == FRAME_INSIDE)
            place_groups(sources, now, f, true, placed);
        else
            place_groups(sources, now, f, false, placed);
        lanes_store(&now->pose[pose_at(i)], placed, POSE);
    }
}

LANES_INLINE void take_poses(Lanes to[POSE], const Chain *now, const LoopBody *const b[LANES]) {
    const double *from[LANES], *side_by_side;
    double gathered[POSE * BLOCK];
    bool apart = b[0]->frame % LANES != 0;
    for (size_t k = 0; k < LANES; k++) {
        from[k] = &now->pose[b[k]->frame];
        apart = apart || from[k] != from[0] + k;
    }
    side_by_side = from[0];
    if (apart) {
        lanes_gather(to, from, BLOCK, POSE);
        lanes_store(gathered, to, POSE);
        side_by_side = gathered;
    }
    lanes_load(to, side_by_side, POSE);
}

LANES_INLINE void take_held(Lanes to[], const LoopBody *const b[LANES], size_t count) {
    lanes_load(to, &LOOP_HELD[b[0]->held], count);
}

LANES_INLINE void take_moments(Lanes to[3], const Sources sources, const LoopBody *const b[LANES]) {
    const double *from[LANES];
    for (size_t k = 0; k < LANES; k++) from[k] = value(sources, b[k]->moments);
    lanes_gather(to, from, 1, 3);
}

/* Sees bodies of one kind from the root's axes. */
LANES_INLINE void see(const Sources sources, const Chain *now, int kind, const LoopBody *const b[LANES], const Lanes *mass,
                      Lanes seen[SEEN]) {
    Lanes pose[POSE], held[POSE], moments[3];
    const Lanes *const arg[] = {pose, mass, held, moments};
    switch (kind) {
        case BODY_FIXED:
            take_poses(pose, now, b);
            take_held(held, b, SEEN);
            lanes_fixed(arg, seen);
            break;
        case BODY_SCALED:
            take_poses(pose, now, b);
            take_held(held, b, SEEN);
            lanes_scaled(arg, seen);
            break;
        case BODY_FREE:
            take_poses(pose, now, b);
            take_held(held, b, POSE);
            take_moments(moments, sources, b);
            lanes_free(arg, seen);
            break;
        case BODY_DIAGONAL:
            take_poses(pose, now, b);
            take_held(moments, b, 3);
            lanes_diagonal(arg, seen);
            break;
        case BODY_DIAGONAL_FREE:
            take_poses(pose, now, b);
            take_moments(moments, sources, b);
            lanes_diagonal(arg, seen);
            break;
        case BODY_OWN_FIXED:
            take_held(held, b, SEEN);
            lanes_own_fixed(arg, seen);
            break;
        case BODY_OWN_SCALED:
            take_held(held, b, SEEN);
            lanes_own_scaled(arg, seen);
            break;
        case BODY_OWN_FREE:
        default:
            take_held(held, b, POSE);
            take_moments(moments, sources, b);
            lanes_own_free(arg, seen);
            break;
    }
}

/* Takes as many bodies as there are lanes: the tables have as many of a kind together. */
LANES_INLINE void take_bodies(const LoopBody *b[LANES], size_t first) {
    for (size_t k = 0; k < LANES; k++) b[k] = &LOOP_BODIES[first + k];
}

LANES_INLINE Lanes masses_of(const Sources sources, const LoopBody *const b[LANES]) {
    double mass[LANES];
    for (size_t k = 0; k < LANES; k++) mass[k] = *value(sources, b[k]->mass);
    return lanes_of(mass);
}

/* Sums masses and first moments of a run of bodies of one kind. Returns where it ends.
   first : the first body's centre in every lane, which that body itself sets */
LANES_INLINE size_t sum_run(const Sources sources, Chain *now, int kind, size_t j, Lanes first[3], double sum[4]) {
    for (; j < LOOP_BODY_COUNT && (int)LOOP_BODIES[j].kind == kind; j += LANES) {
        const LoopBody *b[LANES];
        take_bodies(b, j);
        const Lanes mass = masses_of(sources, b);
        Lanes seen[SEEN], lever[3];
        see(sources, now, kind, b, &mass, seen);
        lanes_store(&now->seen[seen_at(j)], seen, SEEN);
        memcpy(&now->mass[j], &mass, sizeof mass);
        for (size_t i = 0; i < 3 && j == 0; i++) first[i] = lanes_all(now->first[i] = lane_of(seen[i], 0));
        lanes_lever((const Lanes *const[]){&mass, seen, first}, lever);
        for (size_t k = 0; k < LANES; k++) {
            sum[0] += lane_of(mass, k);
            for (size_t i = 0; i < 3; i++) sum[i + 1] += lane_of(lever[i], k);
        }
    }
    return j;
}

/* Sums masses and first moments about the first body's centre. */
static void sum_masses(const Sources sources, Chain *now) {
    double sum[4] = {0.0, 0.0, 0.0, 0.0};
    Lanes first[3];
    for (size_t j = 0; j < LOOP_BODY_COUNT;) {
        switch (LOOP_BODIES[j].kind) {
            case BODY_FIXED: j = sum_run(sources, now, BODY_FIXED, j, first, sum); break;
            case BODY_SCALED: j = sum_run(sources, now, BODY_SCALED, j, first, sum); break;
            case BODY_FREE: j = sum_run(sources, now, BODY_FREE, j, first, sum); break;
            case BODY_DIAGONAL: j = sum_run(sources, now, BODY_DIAGONAL, j, first, sum); break;
            case BODY_DIAGONAL_FREE: j = sum_run(sources, now, BODY_DIAGONAL_FREE, j, first, sum); break;
            case BODY_OWN_FIXED: j = sum_run(sources, now, BODY_OWN_FIXED, j, first, sum); break;
            case BODY_OWN_SCALED: j = sum_run(sources, now, BODY_OWN_SCALED, j, first, sum); break;
            case BODY_OWN_FREE: j = sum_run(sources, now, BODY_OWN_FREE, j, first, sum); break;
        }
    }
    memcpy(now->sum, sum, sizeof sum);
}

/* Sums inertia about the common centre. */
static void sum_inertia(Chain *now) {
    double inertia[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    Lanes first[3], middle[3];
    for (size_t i = 0; i < 3; i++) {
        first[i] = lanes_all(now->first[i]);
        middle[i] = lanes_all(now->middle[i]);
    }
    for (size_t j = 0; j < LOOP_BODY_COUNT; j += LANES) {
        const Lanes mass = lanes_of(&now->mass[j]);
        Lanes seen[SEEN], own[6];
        lanes_load(seen, &now->seen[seen_at(j)], SEEN);
        lanes_spread((const Lanes *const[]){&mass, seen, first, middle}, own);
        for (size_t k = 0; k < LANES; k++)
            for (size_t i = 0; i < 6; i++) inertia[i] += lane_of(own[i], k);
    }
    memcpy(now->inertia, inertia, sizeof inertia);
}

static void put_together(const double p[], Chain *now, double *w) {
    const Sources sources = {p, LOOP_HELD};
    place_frames(sources, now);
    sum_masses(sources, now);
    const double *sum[] = {now->sum};
    double *middle[] = {now->middle};
    loop_middle(sum, middle, NULL, w, 0);
    sum_inertia(now);
}

/* w: a chain, its variation, then what the kernels need. */
int composite(const double **arg, double **res, int *iw, double *w, int mem) {
    Chain *now = (Chain *)w;
    put_together(arg[0], now, w + LOOP_WORK);
    const double *whole[] = {now->sum, now->first, now->middle, now->inertia};
    return loop_finish(whole, res, iw, w + LOOP_WORK, mem);
}

/* A body and a frame as single ones, for derivatives. */
typedef struct {
    double pose[POSE], held[POSE], seen[SEEN];
    const double *mass, *moments;
} One;

static const LoopBody *take_body(One *one, const Sources sources, const Chain *now, size_t body) {
    const LoopBody *b = &LOOP_BODIES[body];
    take(one->pose, &now->pose[b->frame], POSE);
    take(one->held, &LOOP_HELD[b->held], HELD_COUNT[b->kind]);
    take(one->seen, &now->seen[seen_at(body)], SEEN);
    one->mass = value(sources, b->mass);
    one->moments = b->kind == BODY_DIAGONAL ? one->held : value(sources, b->moments);
    return b;
}

int composite_forward(const double **arg, double **res, int *iw, double *w, int mem) {
    const double *p = arg[0], *dp = arg[1];
    Chain *now = (Chain *)w;
    ChainVariation *d = (ChainVariation *)(now + 1);
    const Sources sources = {p, LOOP_HELD};
    One one;
    w += LOOP_WORK;
    put_together(p, now, w);
    memset(d, 0, sizeof *d);
    for (size_t i = 1; i < LOOP_FRAME_COUNT; i++) {
        const LoopFrame *f = &LOOP_FRAMES[i];
        double *to[] = {d->pose[i]};
        const double *pose = take(one.pose, &now->pose[f->parent], POSE), *dpose = d->pose[frame_at(f->parent)];
        const double *parent = value(sources, f->parent_port), *child = value(sources, f->child_port);
        const double *dparent = change(dp, f->parent_port), *dchild = change(dp, f->child_port);
        if (f->kind == FRAME_INSIDE) {
            const double *from[] = {pose, &LOOP_HELD[f->inside], parent, child, dpose, NOTHING, dparent, dchild};
            loop_hang_inside_forward(from, to, iw, w, mem);
        } else {
            const double *from[] = {pose, parent, child, dpose, dparent, dchild};
            loop_hang_forward(from, to, iw, w, mem);
        }
    }
    for (size_t j = 0; j < LOOP_BODY_COUNT; j++) {
        const LoopBody *b = take_body(&one, sources, now, j);
        const double *dmass = change(dp, b->mass);
        const double *from[] = {one.pose, one.mass, one.held, one.moments,
                                d->pose[frame_at(b->frame)], dmass, NOTHING, change(dp, b->moments)};
        double *to[] = {d->seen[j]};
        SEE_FORWARD[b->kind](from, to, iw, w, mem);
        const double *weighed[] = {now->sum, one.mass, one.seen, now->first, d->sum, dmass, d->seen[j], d->seen[0]};
        to[0] = d->sum;
        loop_weigh_forward(weighed, to, iw, w, mem);
    }
    const double *sum[] = {now->sum, d->sum};
    double *middle_of[] = {d->middle};
    loop_middle_forward(sum, middle_of, iw, w, mem);
    for (size_t j = 0; j < LOOP_BODY_COUNT; j++) {
        const LoopBody *b = take_body(&one, sources, now, j);
        const double *from[] = {now->inertia, one.mass, one.seen, now->first, now->middle,
                                d->inertia, change(dp, b->mass), d->seen[j], d->seen[0], d->middle};
        double *to[] = {d->inertia};
        loop_add_forward(from, to, iw, w, mem);
    }
    const double *whole[] = {now->sum, now->first, now->middle, now->inertia,
                             d->sum, d->seen[0], d->middle, d->inertia};
    return loop_finish_forward(whole, res, iw, w, mem);
}

/* Weights on bodies to those on their frames and on p. */
static void bodies_reverse(const Sources sources, const Chain *now, ChainVariation *v, double wp[], double *w) {
    for (size_t j = 0; j < LOOP_BODY_COUNT; j++) {
        One one;
        const LoopBody *b = take_body(&one, sources, now, j);
        double pose[POSE], mass[1], held[POSE], moments[3];
        const double *from[] = {one.pose, one.mass, one.held, one.moments, v->seen[j]};
        double *to[] = {pose, mass, held, moments};
        SEE_REVERSE[b->kind](from, to, NULL, w, 0);
        add_to(v->pose[frame_at(b->frame)], pose, POSE);
        add_weights(wp, b->mass, mass, 1);
        add_weights(wp, b->moments, moments, 3);
    }
}

static void frames_reverse(const Sources sources, const Chain *now, ChainVariation *v, double wp[], double *w) {
    for (size_t i = LOOP_FRAME_COUNT - 1; i > 0; i--) {
        const LoopFrame *f = &LOOP_FRAMES[i];
        double outer[POSE], pose[POSE], inside[POSE], parent[PORT], child[PORT];
        const double *parent_port = value(sources, f->parent_port), *child_port = value(sources, f->child_port);
        take(outer, &now->pose[f->parent], POSE);
        if (f->kind == FRAME_INSIDE) {
            const double *from[] = {outer, &LOOP_HELD[f->inside], parent_port, child_port, v->pose[i]};
            double *to[] = {pose, inside, parent, child};
            loop_hang_inside_reverse(from, to, NULL, w, 0);
        } else {
            const double *from[] = {outer, parent_port, child_port, v->pose[i]};
            double *to[] = {pose, parent, child};
            loop_hang_reverse(from, to, NULL, w, 0);
        }
        add_to(v->pose[frame_at(f->parent)], pose, POSE);
        add_weights(wp, f->parent_port, parent, PORT);
        add_weights(wp, f->child_port, child, PORT);
    }
}

int composite_reverse(const double **arg, double **res, int *iw, double *w, int mem) {
    const double *p = arg[0];
    double *wp = res[0];
    Chain *now = (Chain *)w;
    ChainVariation *v = (ChainVariation *)(now + 1);
    const Sources sources = {p, LOOP_HELD};
    One one;
    w += LOOP_WORK;
    put_together(p, now, w);
    memset(v, 0, sizeof *v);
    memset(wp, 0, INPUT_P_COUNT * sizeof(double));
    const double *whole[] = {now->sum, now->first, now->middle, now->inertia, arg[1]};
    double first[3], part[3], sum[4], inertia[6], mass[1], seen[SEEN];
    double *of_whole[] = {v->sum, first, v->middle, v->inertia};
    loop_finish_reverse(whole, of_whole, iw, w, mem);
    for (size_t j = 0; j < LOOP_BODY_COUNT; j++) {
        const LoopBody *b = take_body(&one, sources, now, j);
        const double *from[] = {now->inertia, one.mass, one.seen, now->first, now->middle, v->inertia};
        double of_middle[3];
        double *to[] = {inertia, mass, seen, part, of_middle};
        loop_add_reverse(from, to, iw, w, mem);
        add_weights(wp, b->mass, mass, 1);
        add_to(v->seen[j], seen, SEEN);
        add_to(first, part, 3);
        add_to(v->middle, of_middle, 3);
    }
    const double *of_middle[] = {now->sum, v->middle};
    double *on_sum[] = {sum};
    loop_middle_reverse(of_middle, on_sum, iw, w, mem);
    add_to(v->sum, sum, 4);
    for (size_t j = 0; j < LOOP_BODY_COUNT; j++) {
        const LoopBody *b = take_body(&one, sources, now, j);
        const double *from[] = {now->sum, one.mass, one.seen, now->first, v->sum};
        double *to[] = {sum, mass, seen, part};
        loop_weigh_reverse(from, to, iw, w, mem);
        add_weights(wp, b->mass, mass, 1);
        add_to(v->seen[j], seen, SEEN);
        add_to(first, part, 3);
    }
    add_to(v->seen[0], first, 3);
    bodies_reverse(sources, now, v, wp, w);
    frames_reverse(sources, now, v, wp, w);
    return 0;
}
