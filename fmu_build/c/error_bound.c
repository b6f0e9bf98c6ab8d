/* The bound of what law and method are off by: over each change of inputs and each sub-step.

   Owns bound, bound_from and errors[BOUND] of Dynamics, and told. The angle never shrinks, and two attitudes are never
   more than pi apart: a bound that has reached pi says nothing and stays there, uncomputed. Needs of the model:
   bound_step, bound_kept_rate, bound_kept_momentum, where a change keeps the momentum keep_momentum, and the part of a
   that follows from the composite alone. */
#include "error_bound.h"

#include <string.h>

#include "composite.h"
#include "docks.h"
#include "model.h"
#include "variables.h"

static const double PI = 3.14159265358979323846;

enum { ANGLE, ENERGY, RATE, PLACE };

enum { BOUND_COUNT = sizeof ((Dynamics *)0)->bound / sizeof(double) };

static bool says_nothing(const Dynamics *now) {
    return !(now->bound[ANGLE] < PI);
}

static void lose(Instance *instance) {
    Dynamics *now = &instance->now;
    now->bound[ANGLE] = now->errors[BOUND] = PI;
    now->bound[ENERGY] = 0.0;
    now->bound[RATE] = DBL_MAX;
    instance->outputs_are_current = false;
}

/* Whether a body of this composite can be turned by a torque. */
static bool has_inertia(const double c[]) {
    bool has = true;
    for (size_t i = COMPOSITE_MARGINS; i < COMPOSITE_LAW; i++) has = has && c[i] > 0.0;
    return has;
}

void bound_remember(Instance *instance) {
    Dynamics *now = &instance->now;
    memcpy(now->bound_from.rate, instance_x(instance) + 4, sizeof now->bound_from.rate);
    memcpy(now->bound_from.c, now->c, sizeof now->c);
    memcpy(now->bound_from.p, now->p, sizeof now->p);
}

void bound_start(Instance *instance) {
    memset(instance->now.bound, 0, sizeof instance->now.bound);
    instance->now.errors[BOUND] = 0.0;
    if (instance->now.model_exchange) lose(instance);
    bound_remember(instance);
}

/* Both rates stay while the composite goes from c to d. */
static void keep_both_rates(Instance *instance, const double c[], const double d[]) {
    double *energy = &instance->now.bound[ENERGY], after;
    instance->arg[0] = energy;
    instance->arg[1] = c;
    instance->arg[2] = d;
    instance->res[0] = &after;
    bound_kept_rate(instance->arg, instance->res, instance->iw, instance->w, 0);
    *energy = after;
}

/* The true momentum stays while the composite goes from c to d, and the rate becomes `turned`. */
static void keep_true_momentum(Instance *instance, const double c[], const double d[], const double rate[3],
                               const double turned[3]) {
    double *energy = &instance->now.bound[ENERGY], after;
    instance->arg[0] = energy;
    instance->arg[1] = c;
    instance->arg[2] = d;
    instance->arg[3] = rate;
    instance->arg[4] = turned;
    instance->res[0] = &after;
    bound_kept_momentum(instance->arg, instance->res, instance->iw, instance->w, 0);
    *energy = after;
}

#if BOUND_MASSES_KEEP_MOMENTUM || BOUND_POSES_KEEP_MOMENTUM
#include "stages.h"

/* Makes a stage's composite current. Returns whether it has mass and inertia. */
static bool weigh(Instance *instance, Stage *stage) {
    if (!stage->c_is_current) composite_compute(instance, stage->p, stage->c);
    stage->c_is_current = true;
    return composite_is_usable(stage->c) && has_inertia(stage->c);
}

/* The rate of this model after a change from c to d under which the momentum stays. */
static void turn(Instance *instance, const double c[], const double d[], const double rate[3], double turned[3]) {
    memcpy(turned, rate, 3 * sizeof(double));
#if CHANGES
    instance->arg[0] = rate;
    instance->arg[1] = c;
    instance->arg[2] = d;
    instance->res[0] = turned;
    keep_momentum(instance->arg, instance->res, instance->iw, instance->w, 0);
#else
    (void)instance, (void)c, (void)d;
#endif
}

/* Inputs of some kinds change, docks that open having opened; c becomes the composite that the energy norm is of. */
static bool keep_while(Instance *instance, Stage *stage, unsigned kind, double rate[3], double c[]) {
    Stage next = *stage;
    double turned[3];
    if (!move_stage(&next, instance->now.p, kind)) return true;
    if (!weigh(instance, stage) || !weigh(instance, &next)) return false;
    turn(instance, stage->c, next.c, rate, turned);
    keep_both_rates(instance, c, stage->c);
    keep_true_momentum(instance, stage->c, next.c, rate, turned);
    memcpy(rate, turned, sizeof turned);
    memcpy(c, next.c, sizeof next.c);
    *stage = next;
    return true;
}

/* Takes the bound to where masses and poses have changed and docks have not closed; c likewise. */
static bool follow_stages(Instance *instance, double c[]) {
    Stage stage;
    double rate[3];
    memcpy(rate, instance->now.bound_from.rate, sizeof rate);
    first_stage(&stage, instance->now.bound_from.p, c, instance->now.p);
    if (BOUND_MASSES_KEEP_MOMENTUM) {
        if (!keep_while(instance, &stage, KIND_MASS, rate, c)) return false;
    } else
        move_stage(&stage, instance->now.p, KIND_MASS);
    return !BOUND_POSES_KEEP_MOMENTUM || keep_while(instance, &stage, KIND_POSE, rate, c);
}

#else

static bool follow_stages(Instance *instance, double c[]) {
    (void)instance, (void)c;
    return true;
}

#endif

/* Whether a dock closes in motion under a law that leaves the rate: what it brings along is not followed. */
static bool closes_unseen(const Instance *instance) {
    bool unseen = false;
#if DOCK_COUNT && !CHANGES
    const Dynamics *now = &instance->now;
    for (size_t i = 0; i < DOCK_COUNT; i++) {
        const Dock *dock = &DOCKS[i];
        if (dock->flag < 0 || now->p[dock->flag] == 0.0 || now->bound_from.p[dock->flag] != 0.0) continue;
        const double *motion = &now->values[REFERENCE_CONTACT + dock->motion];
        for (size_t k = 0; k < 6; k++) unseen = unseen || motion[k] != 0.0;
    }
#else
    (void)instance;
#endif
    return unseen;
}

/* Takes the energy norm over a change. Returns false where nothing is known of it any more. */
static bool follow_change(Instance *instance) {
    double c[COMPOSITE_COUNT];
    memcpy(c, instance->now.bound_from.c, sizeof c);
    if (!has_inertia(instance->now.c) || !has_inertia(c) || closes_unseen(instance)) return false;
    if (!follow_stages(instance, c)) return false;
    keep_both_rates(instance, c, instance->now.c);
    return isfinite(instance->now.bound[ENERGY]);
}

/* Where a communication step starts the place is what the inputs say. */
static void forget_place(Instance *instance) {
#if FIELD
    instance->now.bound[PLACE] = 0.0;
#else
    (void)instance;
#endif
}

/* Composites on the way of a change are judged by nobody else: the importer is to see no flag that they raise. */
void bound_over_change(Instance *instance) {
    const Dynamics *now = &instance->now;
    forget_place(instance);
    if (says_nothing(now) || memcmp(now->p, now->bound_from.p, INPUT_P_COUNT * sizeof(double)) == 0) return;
    fenv_t importers;
    feholdexcept(&importers);
    const bool known = follow_change(instance);
    fesetenv(&importers);
    if (!known) lose(instance);
}

/* Logs, once, that the bound has passed what the scene asks for. */
static void tell(Instance *instance) {
#if ACCURACY_ASKED
    const Dynamics *now = &instance->now;
    const bool turned = now->bound[ANGLE] > ASKED_ATTITUDE, faster = now->bound[RATE] > ASKED_RATE;
    if (instance->told || !(turned || faster)) return;
    instance->told = true;
    instance_inform(instance, LOG_ACCURACY,
                    turned ? "at %.10g s error_bound = %.3g rad passes attitude = %g rad, which [accuracy] asks for"
                           : "at %.10g s the rate's error, up to %.3g rad/s, passes rate = %g rad/s, which [accuracy] "
                             "asks for",
                    now->values[REFERENCE_TIME], turned ? now->bound[ANGLE] : now->bound[RATE],
                    turned ? ASKED_ATTITUDE : ASKED_RATE);
#else
    (void)instance;
#endif
}

static double sum_of_sizes(const double numbers[], size_t count) {
    double sum = 0.0;
    for (size_t i = 0; i < count; i++) sum += fabs(numbers[i]);
    return sum;
}

/* Sizes of a step's numbers up to which, with constants up to TAME_CONSTANTS, whatever the bound is made of is far below
   the largest double: no product in it has more than 500 of their binary digits. */
static const double TAME_STEP = 0x1p40;

/* Of the rates [rad/s, 1/s2] at which the place in a field of gravity changes. */
static double size_of_field(const Instance *instance) {
#if FIELD
    const double *r = instance->left, *v = r + 3;
    const double square = r[0] * r[0] + r[1] * r[1] + r[2] * r[2], distance = sqrt(square);
    return sum_of_sizes(v, 3) / distance + GRAVITY_MU / square / distance;
#else
    (void)instance;
    return 0.0;
#endif
}

/* Takes the bound over a sub-step. Returns false where nothing is known any more: also where numbers are so far from 1
   that what the bound is made of may be no doubles. Where these may be too large, the importer's flags are kept from
   it: that takes twice the time. */
static bool carry(Instance *instance, const double x[], double size, const Progress *progress) {
    Dynamics *now = &instance->now;
    if (!has_inertia(now->c)) return false;
    composite_refresh_axes(instance);
    const double power = progress->was_free ? 0.0 : progress->exponent;
    const double s[4] = {size, power, progress->found[0], progress->found[1]};
    const double sizes = sum_of_sizes(x + 4, 3) + sum_of_sizes(s, 4) + sum_of_sizes(now->bound, BOUND_COUNT) +
                         sum_of_sizes(&now->values[REFERENCE_TORQUE], INPUT_U_COUNT) + size_of_field(instance);
    const bool tame = now->constants_are_tame && sizes <= TAME_STEP;
    if (!tame && !(instance_is_ordinary(instance) && are_within(x, STATE_COUNT, ORDINARY))) return false;
    double after[BOUND_COUNT];
    instance_set_arguments(instance);
    instance->arg[0] = x;
#if FIELD
    double acted[INPUT_U_COUNT];
    memcpy(acted, instance->acting, sizeof acted);
    memcpy(&acted[FIELD_PLACE], instance->left, sizeof instance->left);
    instance->arg[1] = acted;
#endif
    instance->arg[4] = s;
    instance->arg[5] = now->bound;
    instance->res[0] = after;
    instance_call(instance, bound_step, tame);
    if (!isless(after[ANGLE], PI) || !isfinite(after[ENERGY]) || !isfinite(after[RATE])) return false;
    memcpy(now->bound, after, sizeof after);
    now->errors[BOUND] = after[ANGLE];
    return true;
}

void bound_over_sub_step(Instance *instance, const double x[], double size, const Progress *progress) {
    if (!says_nothing(&instance->now) && !carry(instance, x, size, progress)) lose(instance);
    tell(instance);
}
