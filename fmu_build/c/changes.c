#include "changes.h"

#include <math.h>
#include <string.h>

#include "model.h"

#if CHANGES

static void copy_p(double to[], const double from[]) {
    memcpy(to, from, INPUT_P_COUNT * sizeof(double));
}

/* Takes inputs of some kinds over from p; docks that close only if asked to. Returns whether any was another. */
static bool take_over(double stage[], const double p[], unsigned kinds, bool closing) {
    bool changed = false;
    for (size_t i = 0; i < INPUT_P_COUNT; i++) {
        if (!(INPUT_KINDS[i] & kinds) || stage[i] == p[i]) continue;
        if (INPUT_KINDS[i] == KIND_DOCKED && !closing && p[i] != 0.0) continue;
        stage[i] = p[i];
        changed = true;
    }
    return changed;
}

#if MASSES_KEEP_MOMENTUM || POSES_KEEP_MOMENTUM

/* Goes on from a stage with composite c to one where inputs of some kinds are as in p, keeping the momentum. */
static Status keep(Instance *instance, double stage[], double c[], const double p[], unsigned kinds, double rate[3]) {
    double next_c[COMPOSITE_COUNT], next[3];
    if (!take_over(stage, p, kinds, false)) return STATUS_OK;
    const Status status = composite_compute(instance, stage, next_c);
    if (status != STATUS_OK) return status;
    instance->arg[0] = rate;
    instance->arg[1] = c;
    instance->arg[2] = next_c;
    instance->res[0] = next;
    keep_momentum(instance->arg, instance->res, instance->iw, instance->w, 0);
    memcpy(rate, next, sizeof next);
    memcpy(c, next_c, sizeof next_c);
    return STATUS_OK;
}

#endif

#if DOCK_COUNT

/* Adds what the docks that close bring along; c is the composite with them closed. */
static void dock(Instance *instance, const double stage[], const double p[], const double c[], double rate[3]) {
    double motion[INPUT_K_COUNT], momentum[3], next[3];
    memcpy(motion, &instance->now.values[REFERENCE_CONTACT], sizeof motion);
    for (size_t i = 0; i < DOCK_COUNT; i++) {
        const bool closes = DOCKS[i].flag >= 0 && p[DOCKS[i].flag] != 0.0 && stage[DOCKS[i].flag] == 0.0;
        if (DOCKS[i].flag >= 0 && !closes) memset(&motion[DOCKS[i].motion], 0, 6 * sizeof(double));
    }
    instance->arg[0] = p;
    instance->arg[1] = motion;
    instance->res[0] = momentum;
    contact_momentum(instance->arg, instance->res, instance->iw, instance->w, 0);
    instance->arg[0] = rate;
    instance->arg[1] = momentum;
    instance->arg[2] = c;
    instance->res[0] = next;
    docked_rate(instance->arg, instance->res, instance->iw, instance->w, 0);
    memcpy(rate, next, sizeof next);
}

#endif

/* The angular velocity after a change from what was committed to p, whose composite is c. */
static Status rate_after(Instance *instance, const double p[], const double c[], double rate[3]) {
    const Dynamics *now = &instance->now;
    double stage[INPUT_P_COUNT];
    memcpy(rate, now->kept_rate, sizeof now->kept_rate);
    if (memcmp(p, now->stepped_p, sizeof stage) == 0) return STATUS_OK;
    copy_p(stage, now->stepped_p);
#if MASSES_KEEP_MOMENTUM || POSES_KEEP_MOMENTUM
    double stage_c[COMPOSITE_COUNT];
    memcpy(stage_c, now->kept_c, sizeof stage_c);
    Status status = STATUS_OK;
    bool left = take_over(stage, p, KIND_DOCKED, false);
#if !MASSES_KEEP_MOMENTUM
    left = take_over(stage, p, KIND_MASS, false) || left;
#endif
    if (left) status = composite_compute(instance, stage, stage_c);
#if MASSES_KEEP_MOMENTUM
    if (status == STATUS_OK) status = keep(instance, stage, stage_c, p, KIND_MASS, rate);
#endif
#if POSES_KEEP_MOMENTUM
    if (status == STATUS_OK) status = keep(instance, stage, stage_c, p, KIND_POSE, rate);
#endif
    if (status != STATUS_OK) return status;
#endif
#if DOCK_COUNT
    dock(instance, stage, p, c, rate);
#else
    (void)c;
#endif
    for (size_t i = 0; i < 3; i++)
        if (!isfinite(rate[i]))
            return instance_refuse(instance, "the change leaves angular_velocity = (%.10g, %.10g, %.10g) rad/s", rate[0],
                                   rate[1], rate[2]);
    return STATUS_OK;
}

static void become_current(Instance *instance, const double p[], const double c[]) {
    Dynamics *now = &instance->now;
    if (p != now->p) copy_p(now->p, p);
    if (c != now->c) memcpy(now->c, c, sizeof now->c);
}

static void begin_from_now(Dynamics *now) {
    copy_p(now->stepped_p, now->p);
    memcpy(now->kept_c, now->c, sizeof now->kept_c);
}

#if STATE_IS_MOMENTUM

static bool states_lead(const Instance *instance) {
    return instance->now.model_exchange && !(instance->now.state & BEFORE_START);
}

static void momentum_from_rate(Instance *instance, const double rate[3], double momentum[3]) {
    instance->arg[0] = rate;
    instance->arg[1] = instance->now.c;
    instance->res[0] = momentum;
    momentum_of(instance->arg, instance->res, instance->iw, instance->w, 0);
}

void changes_mirror(Instance *instance) {
    if (instance->mirror_is_current) return;
    double *x = instance_x(instance), *states = instance_states(instance);
    if (states_lead(instance)) {
        memcpy(x, states, 4 * sizeof(double));
        instance->arg[0] = states + 4;
        instance->arg[1] = instance->now.c;
        instance->res[0] = x + 4;
        rate_of_momentum(instance->arg, instance->res, instance->iw, instance->w, 0);
    } else {
        memcpy(states, x, 4 * sizeof(double));
        momentum_from_rate(instance, x + 4, states + 4);
    }
    instance->mirror_is_current = true;
}

/* A dock that opened or closed has changed the momentum; everything else keeps it. */
static bool docks_moved(const Instance *instance) {
    bool moved = false;
    for (size_t i = 0; i < INPUT_P_COUNT; i++)
        moved = moved || (INPUT_KINDS[i] == KIND_DOCKED && instance->now.p[i] != instance->now.stepped_p[i]);
    return moved;
}

#else

void changes_mirror(Instance *instance) {
    (void)instance;
}

/* In continuous time a change that keeps momentum beside others that keep the rate would need the inputs' rates. */
static Status check_continuous(Instance *instance, const double p[]) {
    const unsigned keeping = (MASSES_KEEP_MOMENTUM ? KIND_MASS : 0) | (POSES_KEEP_MOMENTUM ? KIND_POSE : 0);
    for (size_t i = 0; i < INPUT_P_COUNT; i++) {
        if (!(INPUT_KINDS[i] & keeping) || p[i] == instance->now.stepped_p[i]) continue;
        const Variable *variable = &VARIABLES[REFERENCE_P + i];
        return instance_refuse(instance,
                               "%s = %.10g%s%s: changed from %.10g in continuous-time mode, but %s keep the angular "
                               "momentum and %s the angular velocity, so that its rate would have to be known; change "
                               "it in event mode",
                               variable->name, p[i], variable->unit[0] ? " " : "", variable->unit,
                               instance->now.stepped_p[i], POSES_KEEP_MOMENTUM ? "poses" : "masses",
                               POSES_KEEP_MOMENTUM ? "masses" : "poses");
    }
    return STATUS_OK;
}

#endif

Status changes_apply(Instance *instance, const double p[], const double c[]) {
    Dynamics *now = &instance->now;
    double rate[3];
    if (now->state & BEFORE_START) {
        become_current(instance, p, c);
        instance->mirror_is_current = false;
        return STATUS_OK;
    }
    if (now->state == CONTINUOUS) {
#if !STATE_IS_MOMENTUM
        const Status status = check_continuous(instance, p);
        if (status != STATUS_OK) return status;
#endif
        become_current(instance, p, c);
        begin_from_now(now);
        instance->mirror_is_current = false;
        return STATUS_OK;
    }
    const Status status = rate_after(instance, p, c, rate);
    if (status != STATUS_OK) return status;
    become_current(instance, p, c);
    instance->mirror_is_current = false;
#if STATE_IS_MOMENTUM
    if (states_lead(instance)) {
        double *momentum = instance_states(instance) + 4;
        memcpy(momentum, now->kept_momentum, sizeof now->kept_momentum);
        if (docks_moved(instance)) momentum_from_rate(instance, rate, momentum);
        return STATUS_OK;
    }
#endif
    memcpy(instance_x(instance) + 4, rate, sizeof rate);
    return STATUS_OK;
}

void changes_commit(Instance *instance) {
    Dynamics *now = &instance->now;
    changes_mirror(instance);
    begin_from_now(now);
    memcpy(now->kept_rate, instance_x(instance) + 4, sizeof now->kept_rate);
#if STATE_IS_MOMENTUM
    memcpy(now->kept_momentum, instance_states(instance) + 4, sizeof now->kept_momentum);
#endif
}

bool changes_moved(const Instance *instance) {
#if STATE_IS_MOMENTUM
    return memcmp(instance->now.kept_momentum, &instance->now.values[REFERENCE_STATES + 4], 3 * sizeof(double)) != 0;
#else
    return memcmp(instance->now.kept_rate, &instance->now.values[REFERENCE_STATES + 4], 3 * sizeof(double)) != 0;
#endif
}

#endif

#if DOCK_COUNT

/* The part that a vessel belongs to, by the number of one of its vessels. */
static int part_of(const int joined[], int vessel) {
    while (joined[vessel] != vessel) vessel = joined[vessel];
    return vessel;
}

static const char *flag_name(const Dock *dock) {
    return VARIABLES[REFERENCE_P + dock->flag].name;
}

/* Adds a closed dock to those before it: each port once, no loop. */
static Status close_dock(Instance *instance, const Dock *closing, const Dock *const closed[], size_t count, int joined[]) {
    for (size_t i = 0; i < count; i++)
        for (size_t k = 0; k < 4; k++)
            if (strcmp(closing->ports[k / 2], closed[i]->ports[k % 2]) == 0)
                return instance_refuse(instance, "%s = true: port %s is docked already, to %s", flag_name(closing),
                                       closing->ports[k / 2], closed[i]->ports[1 - k % 2]);
    const int one = part_of(joined, closing->vessel[0]), other = part_of(joined, closing->vessel[1]);
    if (one == other)
        return instance_refuse(instance, "%s = true: %s - %s closes a loop; %s and %s are joined already",
                               flag_name(closing), closing->ports[0], closing->ports[1], closing->vessels[0],
                               closing->vessels[1]);
    joined[other] = one;
    return STATUS_OK;
}

/* Docks that were closed before come first, so that the one which closes is to blame. */
static int turn_of(const Instance *instance, const Dock *dock, const double p[]) {
    if (dock->flag < 0) return 0;
    if (p[dock->flag] == 0.0) return -1;
    return instance->now.stepped_p[dock->flag] != 0.0 ? 1 : 2;
}

Status changes_check_docks(Instance *instance, const double p[]) {
    const Dock *closed[DOCK_COUNT];
    int joined[VESSEL_COUNT];
    size_t count = 0;
    Status status = STATUS_OK;
    for (int i = 0; i < VESSEL_COUNT; i++) joined[i] = i;
    for (int turn = 0; turn <= 2; turn++)
        for (size_t i = 0; i < DOCK_COUNT && status == STATUS_OK; i++) {
            if (turn_of(instance, &DOCKS[i], p) != turn) continue;
            status = close_dock(instance, &DOCKS[i], closed, count, joined);
            closed[count++] = &DOCKS[i];
        }
    return status;
}

#else

Status changes_check_docks(Instance *instance, const double p[]) {
    (void)instance, (void)p;
    return STATUS_OK;
}

#endif

#if STATE_IS_MOMENTUM

void changes_start_forward(Instance *instance, Variation *v) {
    double momentum[3];
    instance->arg[0] = instance_x(instance) + 4;
    instance->arg[1] = instance->now.c;
    instance->arg[2] = v->x + 4;
    instance->arg[3] = v->c;
    instance->res[0] = momentum;
    momentum_of_forward(instance->arg, instance->res, instance->iw, instance->w, 0);
    memcpy(v->x + 4, momentum, sizeof momentum);
}

void changes_start_reverse(Instance *instance, Variation *v) {
    double rate[3], c[COMPOSITE_COUNT];
    instance->arg[0] = instance_x(instance) + 4;
    instance->arg[1] = instance->now.c;
    instance->arg[2] = v->x + 4;
    instance->res[0] = rate;
    instance->res[1] = c;
    momentum_of_reverse(instance->arg, instance->res, instance->iw, instance->w, 0);
    memcpy(v->x + 4, rate, sizeof rate);
    for (size_t i = 0; i < COMPOSITE_COUNT; i++) v->c[i] += c[i];
}

#elif MASSES_KEEP_MOMENTUM || POSES_KEEP_MOMENTUM

/* The two stages between which momentum was kept last, or would be: before it and after it. */
typedef struct {
    double before[INPUT_P_COUNT], after[INPUT_P_COUNT];
    double before_c[COMPOSITE_COUNT], after_c[COMPOSITE_COUNT];
    unsigned varied_before, varied_after; /* kinds of inputs that are as now */
} Stages;

/* Of kinds that keep the rate, those before the one that keeps momentum belong to both stages. */
static Status stages_of(Instance *instance, Stages *stages) {
    const Dynamics *now = &instance->now;
    stages->varied_before = MASSES_KEEP_MOMENTUM ? 0 : KIND_MASS;
    stages->varied_after = MASSES_KEEP_MOMENTUM ? KIND_MASS : KIND_MASS | KIND_POSE;
    copy_p(stages->before, now->stepped_p);
    take_over(stages->before, now->p, stages->varied_before, false);
    take_over(stages->before, now->p, KIND_DOCKED, false);
    copy_p(stages->after, stages->before);
    take_over(stages->after, now->p, stages->varied_after, false);
    const Status status = composite_compute(instance, stages->before, stages->before_c);
    return status == STATUS_OK ? composite_compute(instance, stages->after, stages->after_c) : status;
}

/* Changes of a composite, dc, by those of the inputs of some kinds. */
static void composite_change(Instance *instance, const double p[], const Variation *v, unsigned kinds, double dc[]) {
    double dp[INPUT_P_COUNT];
    for (size_t i = 0; i < INPUT_P_COUNT; i++) dp[i] = INPUT_KINDS[i] & kinds ? v->inputs[i] : 0.0;
    instance->arg[0] = p;
    instance->arg[1] = dp;
    instance->res[0] = dc;
    composite_forward(instance->arg, instance->res, instance->iw, instance->w, 0);
}

void changes_forward(Instance *instance, Variation *v) {
    Stages stages;
    double before[COMPOSITE_COUNT], after[COMPOSITE_COUNT], change[3];
    static const double none[3] = {0.0, 0.0, 0.0};
    if (stages_of(instance, &stages) != STATUS_OK) return;
    composite_change(instance, stages.before, v, stages.varied_before, before);
    composite_change(instance, stages.after, v, stages.varied_after, after);
    const double *const arguments[] = {instance->now.kept_rate, stages.before_c, stages.after_c, none, before, after};
    memcpy(instance->arg, arguments, sizeof arguments);
    instance->res[0] = change;
    keep_momentum_forward(instance->arg, instance->res, instance->iw, instance->w, 0);
    for (size_t i = 0; i < 3; i++) v->x[4 + i] += change[i];
}

/* Adds weights on inputs of some kinds that follow from those on a composite. */
static void composite_weights(Instance *instance, const double p[], const double wc[], unsigned kinds, Variation *v) {
    double wp[INPUT_P_COUNT];
    instance->arg[0] = p;
    instance->arg[1] = wc;
    instance->res[0] = wp;
    composite_reverse(instance->arg, instance->res, instance->iw, instance->w, 0);
    for (size_t i = 0; i < INPUT_P_COUNT; i++)
        if (INPUT_KINDS[i] & kinds) v->inputs[i] += wp[i];
}

void changes_reverse(Instance *instance, Variation *v) {
    Stages stages;
    double on_rate[3], before[COMPOSITE_COUNT], after[COMPOSITE_COUNT];
    if (stages_of(instance, &stages) != STATUS_OK) return;
    const double *const arguments[] = {instance->now.kept_rate, stages.before_c, stages.after_c, v->x + 4};
    double *const results[] = {on_rate, before, after};
    memcpy(instance->arg, arguments, sizeof arguments);
    memcpy(instance->res, results, sizeof results);
    keep_momentum_reverse(instance->arg, instance->res, instance->iw, instance->w, 0);
    composite_weights(instance, stages.before, before, stages.varied_before, v);
    composite_weights(instance, stages.after, after, stages.varied_after, v);
}

#endif
