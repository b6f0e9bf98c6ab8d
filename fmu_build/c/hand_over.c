/* What an instant of change hands over: computed from the composites on the way of the change, kept until the next one.

   Needs of the model: handed_over with its derivatives; with docks contact_velocity, see docking.c. */
#include "hand_over.h"

#include <math.h>
#include <string.h>

#include "docks.h"
#include "kept_in_changes.h"
#include "model.h"
#include "stages.h"
#include "variables.h"

enum {
    JUMPS = 6,                                                       /* the first elements */
    FREED_KINDS = KIND_DOCKED | (MASSES_KEEP_MOMENTUM ? 0 : KIND_MASS), /* of inputs by which matter comes and goes */
    INNER_KINDS = KIND_MASS | KIND_POSE,
    ARGUMENTS = 7
};

/* A change from the inputs committed: what handed_over takes. Where it is not by way of what is moved inside the body,
   freed and closing are the end of the change. */
typedef struct {
    double x[STATE_COUNT], rate[RATE_COUNT], velocity[3];
    Stage freed, closing;
    bool inner;
} Way;

/* Makes the composite of a stage current. Returns whether it has a mass: it needs no more. */
static bool leaves_a_mass(Instance *instance, Stage *stage) {
    if (!stage->c_is_current) composite_compute(instance, stage->p, stage->c);
    stage->c_is_current = true;
    return stage->c[COMPOSITE_MASS] > 0.0 && isfinite(stage->c[COMPOSITE_MASS]);
}

/* by_stages: goes by way of freed and closing though nothing be moved, if there is a body between. */
static Status find_stages(Instance *instance, const double p[], const double c[], bool by_stages, Way *way) {
    const Dynamics *now = &instance->now;
    first_stage(&way->freed, now->stepped_p, now->kept_c, p);
    move_stage(&way->freed, p, FREED_KINDS);
    way->closing = way->freed;
    const bool moved = move_stage(&way->closing, p, INNER_KINDS);
    if (memcmp(way->closing.p, p, sizeof way->closing.p) == 0) {
        memcpy(way->closing.c, c, sizeof way->closing.c);
        way->closing.c_is_current = true;
    }
    way->inner = (moved || by_stages) && leaves_a_mass(instance, &way->freed) && leaves_a_mass(instance, &way->closing);
    if (way->inner) return STATUS_OK;
    if (moved)
        return instance_refuse(instance,
                               "between the changes of docks, masses and poses nothing is left that has a mass, and "
                               "nobody can say how the barycentre moves; make them one after the other");
    memcpy(way->freed.c, c, sizeof way->freed.c);
    memcpy(way->closing.c, c, sizeof way->closing.c);
    return STATUS_OK;
}

static Status find_way(Instance *instance, const double p[], const double c[], const double rate[RATE_COUNT],
                       bool by_stages, Way *way) {
    memcpy(way->x, instance_x(instance), 4 * sizeof(double));
    memcpy(way->x + 4, instance->now.kept_rate, sizeof instance->now.kept_rate);
    memcpy(way->rate, rate, sizeof way->rate);
    docks_contact_velocity(instance, p, way->velocity);
    return find_stages(instance, p, c, by_stages, way);
}

static void set_way(Instance *instance, const Way *way, const double c[]) {
    const double *const arguments[ARGUMENTS] = {
        way->x, way->rate, instance->now.kept_c, way->freed.c, way->closing.c, c, way->velocity,
    };
    memcpy(instance->arg, arguments, sizeof arguments);
}

static bool is_at(double time, const Dynamics *now) {
    return time == now->values[REFERENCE_TIME];
}

void hand_over_hold(Instance *instance) {
    Dynamics *now = &instance->now;
    if (memcmp(now->p, now->stepped_p, INPUT_P_COUNT * sizeof(double)) == 0)
        now->handed.committed = now->handed.latest;
    else
        now->handed.latest = now->handed.committed;
}

Status hand_over_change(Instance *instance, const double p[], const double c[], const double rate[RATE_COUNT]) {
    Dynamics *now = &instance->now;
    Way way;
    const Status status = find_way(instance, p, c, rate, false, &way);
    if (status != STATUS_OK) return status;
    set_way(instance, &way, c);
    instance->res[0] = now->handed.latest.values;
    instance_call(instance, handed_over, false);
    now->handed.latest.time = now->values[REFERENCE_TIME];
    for (size_t i = 0; i < JUMPS && is_at(now->handed.committed.time, now); i++)
        now->handed.latest.values[i] += now->handed.committed.values[i];
    return STATUS_OK;
}

/* Zeros are not added: they would take the sign of a zero away, in some instants and in others not. */
void hand_over_show(Instance *instance) {
    Dynamics *now = &instance->now;
    const size_t count = is_at(now->handed.latest.time, now) ? HANDED_COUNT : JUMPS;
    for (size_t i = 0; i < count; i++) {
        const double handed = now->handed.latest.values[i];
        if (HANDED_OUTPUTS[i] >= 0 && handed != 0.0) now->values[REFERENCE_OUTPUTS + HANDED_OUTPUTS[i]] += handed;
    }
}

/* Whether a change of the inputs as they are now would make a jump. */
static bool changes_hand_over(const Instance *instance) {
    return !(changes_state(instance) & (BEFORE_START | INTERMEDIATE | CONTINUOUS));
}

/* The change that the inputs have made, with the rate as docks close. */
static Status find_way_to_now(Instance *instance, Way *way) {
    const Dynamics *now = &instance->now;
    double rate[RATE_COUNT];
    changes_begin(instance);
    memcpy(rate, now->kept_rate, sizeof rate);
    const Status status = rate_on_the_way(instance, now->p, now->c, rate);
    return status == STATUS_OK ? find_way(instance, now->p, now->c, rate, true, way) : status;
}

Status hand_over_forward(Instance *instance, Variation *v) {
    if (!changes_hand_over(instance)) return STATUS_OK;
    Way way;
    double x[STATE_COUNT] = {0.0}, before[COMPOSITE_COUNT] = {0.0}, rate[RATE_COUNT] = {0.0};
    double freed[COMPOSITE_COUNT], closing[COMPOSITE_COUNT], velocity[3], handed[HANDED_COUNT];
    Status status = find_way_to_now(instance, &way);
    if (status == STATUS_OK) status = rate_on_the_way_forward(instance, v, rate);
    if (status != STATUS_OK) return status;
    if (way.inner) {
        change_composite(instance, way.freed.p, v, FREED_KINDS, freed);
        change_composite(instance, way.closing.p, v, INNER_KINDS, closing);
    }
    docks_contact_velocity_forward(instance, v, velocity);
    set_way(instance, &way, instance->now.c);
    const double *const small[ARGUMENTS] = {
        x, rate, before, way.inner ? freed : v->c, way.inner ? closing : v->c, v->c, velocity,
    };
    memcpy(instance->arg + ARGUMENTS, small, sizeof small);
    instance->res[0] = handed;
    handed_over_forward(instance->arg, instance->res, instance->iw, instance->w, 0);
    for (size_t i = 0; i < HANDED_COUNT; i++)
        if (HANDED_OUTPUTS[i] >= 0) v->y[HANDED_OUTPUTS[i]] += handed[i];
    return STATUS_OK;
}

Status hand_over_reverse(Instance *instance, Variation *v) {
    if (!changes_hand_over(instance)) return STATUS_OK;
    Way way;
    double weights[HANDED_COUNT], x[STATE_COUNT], rate[RATE_COUNT], velocity[3];
    double before[COMPOSITE_COUNT], freed[COMPOSITE_COUNT], closing[COMPOSITE_COUNT], after[COMPOSITE_COUNT];
    const Status status = find_way_to_now(instance, &way);
    if (status != STATUS_OK) return status;
    for (size_t i = 0; i < HANDED_COUNT; i++) weights[i] = HANDED_OUTPUTS[i] >= 0 ? v->y[HANDED_OUTPUTS[i]] : 0.0;
    set_way(instance, &way, instance->now.c);
    instance->arg[ARGUMENTS] = weights;
    double *const results[ARGUMENTS] = {x, rate, before, freed, closing, after, velocity};
    memcpy(instance->res, results, sizeof results);
    handed_over_reverse(instance->arg, instance->res, instance->iw, instance->w, 0);
    if (way.inner) {
        weigh_inputs(instance, way.freed.p, freed, FREED_KINDS, v);
        weigh_inputs(instance, way.closing.p, closing, INNER_KINDS, v);
    }
    for (size_t i = 0; i < COMPOSITE_COUNT && !way.inner; i++) after[i] += freed[i] + closing[i];
    weigh_inputs(instance, instance->now.p, after, KIND_DOCKED | INNER_KINDS, v);
    docks_contact_velocity_reverse(instance, velocity, v);
    return rate_on_the_way_reverse(instance, rate, v);
}
