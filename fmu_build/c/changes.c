#include "changes.h"

#include <math.h>
#include <string.h>

#include "model.h"

#if DOCK_COUNT

static const char *flag_name(const Dock *dock) {
    return VARIABLES[REFERENCE_P + dock->flag].name;
}

#endif

#if CHANGES

static void copy_p(double to[], const double from[]) {
    memcpy(to, from, INPUT_P_COUNT * sizeof(double));
}

/* Takes inputs of some kinds over from p; docks that close only if asked to. Returns whether any was another. */
static bool take_over(double stage[], const double p[], unsigned kinds, bool closing) {
    enum { AT_ONCE = 64 };
    bool changed = false;
    for (size_t begin = 0; begin < INPUT_P_COUNT; begin += AT_ONCE) {
        const size_t end = begin + AT_ONCE < INPUT_P_COUNT ? begin + AT_ONCE : INPUT_P_COUNT;
        if (memcmp(&stage[begin], &p[begin], (end - begin) * sizeof *p) == 0) continue;
        for (size_t i = begin; i < end; i++) {
            if (!(INPUT_KINDS[i] & kinds) || stage[i] == p[i]) continue;
            if (INPUT_KINDS[i] == KIND_DOCKED && !closing && p[i] != 0.0) continue;
            stage[i] = p[i];
            changed = true;
        }
    }
    return changed;
}

#if MASSES_KEEP_MOMENTUM || POSES_KEEP_MOMENTUM

/* Inputs on the way of a change, and their composite once it is asked for. */
typedef struct {
    double p[INPUT_P_COUNT], c[COMPOSITE_COUNT];
    bool c_is_current;
} Stage;

/* Lets inputs of some kinds be as in p, docks open. */
static bool move_stage(Stage *stage, const double p[], unsigned kinds) {
    const bool changed = take_over(stage->p, p, kinds, false);
    if (changed) stage->c_is_current = false;
    return changed;
}

static Status weigh(Instance *instance, Stage *stage) {
    const Status status = stage->c_is_current ? STATUS_OK : composite_between(instance, stage->p, stage->c);
    stage->c_is_current = status == STATUS_OK;
    return status;
}

/* Where a change to p begins: all as committed, but for the docks that open. */
static void first_stage(const Instance *instance, const double p[], Stage *stage) {
    copy_p(stage->p, instance->now.stepped_p);
    memcpy(stage->c, instance->now.kept_c, sizeof stage->c);
    stage->c_is_current = true;
    move_stage(stage, p, KIND_DOCKED);
}

/* Goes on from a stage to one where inputs of some kinds are as in p, whose composite is c, keeping the momentum. */
static Status keep(Instance *instance, Stage *stage, const double p[], const double c[], unsigned kinds,
                   double rate[3]) {
    if (memcmp(stage->p, p, sizeof stage->p) == 0) return STATUS_OK;
    Stage next = *stage;
    double changed[3];
    if (!move_stage(&next, p, kinds)) return STATUS_OK;
    if (memcmp(next.p, p, sizeof next.p) == 0) {
        memcpy(next.c, c, sizeof next.c);
        next.c_is_current = true;
    }
    Status status = weigh(instance, stage);
    if (status == STATUS_OK) status = weigh(instance, &next);
    if (status != STATUS_OK) return status;
    instance->arg[0] = rate;
    instance->arg[1] = stage->c;
    instance->arg[2] = next.c;
    instance->res[0] = changed;
    keep_momentum(instance->arg, instance->res, instance->iw, instance->w, 0);
    memcpy(rate, changed, sizeof changed);
    *stage = next;
    return STATUS_OK;
}

/* The angular velocity before docks close, after all else has changed to p. */
static Status rate_kept(Instance *instance, const double p[], const double c[], double rate[3]) {
    Stage stage;
    Status status = STATUS_OK;
    first_stage(instance, p, &stage);
#if MASSES_KEEP_MOMENTUM
    status = keep(instance, &stage, p, c, KIND_MASS, rate);
#else
    move_stage(&stage, p, KIND_MASS);
#endif
#if POSES_KEEP_MOMENTUM
    if (status == STATUS_OK) status = keep(instance, &stage, p, c, KIND_POSE, rate);
#endif
    return status;
}

#endif

#if DOCK_COUNT

static bool closes(const Instance *instance, const Dock *dock, const double p[]) {
    return dock->flag >= 0 && p[dock->flag] != 0.0 && instance->now.stepped_p[dock->flag] == 0.0;
}

/* Adds what the docks that close bring along; c is the composite with them closed. */
static void dock(Instance *instance, const double p[], const double c[], double rate[3]) {
    double motion[INPUT_K_COUNT], momentum[3], next[3];
    memcpy(motion, &instance->now.values[REFERENCE_CONTACT], sizeof motion);
    for (size_t i = 0; i < DOCK_COUNT; i++)
        if (DOCKS[i].flag >= 0 && !closes(instance, &DOCKS[i], p))
            memset(&motion[DOCKS[i].motion], 0, 6 * sizeof(double));
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

/* Refuses a change that leaves such a rate; the first dock that closes is named. */
static Status refuse_rate(Instance *instance, const double p[], const double rate[3]) {
    const char *name = "", *words = "the change";
#if DOCK_COUNT
    for (size_t i = DOCK_COUNT; i > 0; i--)
        if (closes(instance, &DOCKS[i - 1], p)) name = flag_name(&DOCKS[i - 1]), words = " = true with this motion";
#else
    (void)p;
#endif
    return instance_refuse(instance, "%s%s leaves angular_velocity = (%.10g, %.10g, %.10g) rad/s: must be finite", name,
                           words, rate[0], rate[1], rate[2]);
}

/* The angular velocity after a change from what was committed to p, whose composite is c. */
static Status rate_after(Instance *instance, const double p[], const double c[], double rate[3]) {
    const Dynamics *now = &instance->now;
    Status status = STATUS_OK;
    memcpy(rate, now->kept_rate, sizeof now->kept_rate);
    if (memcmp(p, now->stepped_p, INPUT_P_COUNT * sizeof(double)) == 0) return STATUS_OK;
#if MASSES_KEEP_MOMENTUM || POSES_KEEP_MOMENTUM
    status = rate_kept(instance, p, c, rate);
#endif
#if DOCK_COUNT
    if (status == STATUS_OK) dock(instance, p, c, rate);
#else
    (void)c;
#endif
    const bool finite = isfinite(rate[0]) && isfinite(rate[1]) && isfinite(rate[2]);
    return status != STATUS_OK || finite ? status : refuse_rate(instance, p, rate);
}

static void become_current(Instance *instance, const double p[], const double c[]) {
    Dynamics *now = &instance->now;
    if (p != now->p) copy_p(now->p, p);
    if (c != now->c) memcpy(now->c, c, sizeof now->c);
}

static void begin_from_now(Dynamics *now) {
    if (memcmp(now->stepped_p, now->p, INPUT_P_COUNT * sizeof(double)) != 0) now->epoch_holds = false;
    copy_p(now->stepped_p, now->p);
    memcpy(now->kept_c, now->c, sizeof now->kept_c);
}

#if STATE_IS_MOMENTUM

static bool states_lead(const Instance *instance) {
    return instance->now.model_exchange && !(changes_state(instance) & BEFORE_START);
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
#if DOCK_COUNT
    for (size_t i = 0; i < INPUT_P_COUNT; i++)
        moved = moved || (INPUT_KINDS[i] == KIND_DOCKED && instance->now.p[i] != instance->now.stepped_p[i]);
#else
    (void)instance;
#endif
    return moved;
}

#else

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

void changes_begin(Instance *instance) {
    Dynamics *now = &instance->now;
    if (now->model_exchange || memcmp(now->p, now->stepped_p, INPUT_P_COUNT * sizeof(double)) != 0) return;
    memcpy(now->kept_rate, instance_x(instance) + 4, sizeof now->kept_rate);
    memcpy(now->kept_c, now->c, sizeof now->kept_c);
}

Status changes_apply(Instance *instance, const double p[], const double c[]) {
    Dynamics *now = &instance->now;
    double rate[3];
    if (changes_state(instance) & BEFORE_START) {
        become_current(instance, p, c);
        instance_state_moved(instance);
        return STATUS_OK;
    }
    if (changes_state(instance) == CONTINUOUS) {
#if !STATE_IS_MOMENTUM
        const Status status = check_continuous(instance, p);
        if (status != STATUS_OK) return status;
#endif
        become_current(instance, p, c);
        begin_from_now(now);
        instance_state_moved(instance);
        return STATUS_OK;
    }
    changes_begin(instance);
    const Status status = rate_after(instance, p, c, rate);
    if (status != STATUS_OK) return status;
    become_current(instance, p, c);
    instance_state_moved(instance);
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
    Stage before, after;
    unsigned varied_before, varied_after; /* kinds of inputs that are as now */
} Stages;

/* Of kinds that keep the rate, those before the one that keeps momentum belong to both stages. */
static Status stages_of(Instance *instance, Stages *stages) {
    changes_begin(instance);
    const Dynamics *now = &instance->now;
    stages->varied_before = MASSES_KEEP_MOMENTUM ? 0 : KIND_MASS;
    stages->varied_after = MASSES_KEEP_MOMENTUM ? KIND_MASS : KIND_MASS | KIND_POSE;
    first_stage(instance, now->p, &stages->before);
    move_stage(&stages->before, now->p, stages->varied_before);
    stages->after = stages->before;
    move_stage(&stages->after, now->p, stages->varied_after);
    const Status status = weigh(instance, &stages->before);
    return status == STATUS_OK ? weigh(instance, &stages->after) : status;
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

Status changes_forward(Instance *instance, Variation *v) {
    Stages stages;
    double before[COMPOSITE_COUNT], after[COMPOSITE_COUNT], change[3];
    static const double none[3] = {0.0, 0.0, 0.0};
    const Status status = stages_of(instance, &stages);
    if (status != STATUS_OK) return status;
    composite_change(instance, stages.before.p, v, stages.varied_before, before);
    composite_change(instance, stages.after.p, v, stages.varied_after, after);
    const double *const arguments[] = {instance->now.kept_rate, stages.before.c, stages.after.c, none, before, after};
    memcpy(instance->arg, arguments, sizeof arguments);
    instance->res[0] = change;
    keep_momentum_forward(instance->arg, instance->res, instance->iw, instance->w, 0);
    for (size_t i = 0; i < 3; i++) v->x[4 + i] += change[i];
    return STATUS_OK;
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

Status changes_reverse(Instance *instance, Variation *v) {
    Stages stages;
    double on_rate[3], before[COMPOSITE_COUNT], after[COMPOSITE_COUNT];
    const Status status = stages_of(instance, &stages);
    if (status != STATUS_OK) return status;
    const double *const arguments[] = {instance->now.kept_rate, stages.before.c, stages.after.c, v->x + 4};
    double *const results[] = {on_rate, before, after};
    memcpy(instance->arg, arguments, sizeof arguments);
    memcpy(instance->res, results, sizeof results);
    keep_momentum_reverse(instance->arg, instance->res, instance->iw, instance->w, 0);
    composite_weights(instance, stages.before.p, before, stages.varied_before, v);
    composite_weights(instance, stages.after.p, after, stages.varied_after, v);
    return STATUS_OK;
}

#endif
