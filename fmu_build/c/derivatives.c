/* Derivatives at what inputs and states are now: judges a request, lays its seed out as a Variation, calls the model's
   derivatives of composite and response one after the other, and gathers what was asked for.

   Owns the variation in scratch while a request is answered; changes nothing else but what a get would make current. */
#include "derivatives.h"

#include <math.h>
#include <string.h>

#include "actions.h"
#include "changes.h"
#include "field.h"
#include "hand_over.h"
#include "model.h"
#include "variables.h"

/* What a reference may stand for in a set of knowns or unknowns, as bits of (1 << role). Once initialisation has ended
   nothing depends on the start parameters any more, since the states are given: derivatives by them are 0. */
static unsigned allowed_knowns(const Instance *instance) {
    const unsigned always = (1u << ROLE_TIME) | (1u << ROLE_INPUT) | (1u << ROLE_PARAMETER);
    return always | (instance->now.state & BEFORE_START ? 0u : 1u << ROLE_STATE);
}

static unsigned allowed_unknowns(const Instance *instance) {
    const unsigned at_start = 1u << ROLE_STATE;
    return (1u << ROLE_OUTPUT) | (1u << ROLE_DERIVATIVE) | (instance->now.state & BEFORE_START ? at_start : 0u);
}

static Status check_roles(Instance *instance, const unsigned references[], size_t count, unsigned allowed,
                          const char *what) {
    const Status status = instance_check_references(instance, references, count);
    if (status != STATUS_OK) return status;
    for (size_t i = 0; i < count; i++)
        if (!(allowed & (1u << VARIABLES[references[i]].role)))
            return instance_error(instance, "%s cannot be %s of a derivative here", VARIABLES[references[i]].name,
                                  what);
    for (size_t i = 0; i < count; i++)
        if (is_boolean(references[i]))
            return instance_error(instance, "%s cannot be %s of a derivative: it is a Boolean",
                                  VARIABLES[references[i]].name, what);
    return STATUS_OK;
}

/* Checks a request and makes state and composite current. */
static Status check_request(Instance *instance, const unsigned unknowns[], size_t unknown_count,
                            const unsigned knowns[], size_t known_count, const double seed[],
                            const double sensitivity[], size_t seed_count, size_t sensitivity_count) {
    Status status = check_roles(instance, unknowns, unknown_count, allowed_unknowns(instance), "an unknown");
    if (status == STATUS_OK)
        status = check_roles(instance, knowns, known_count, allowed_knowns(instance), "a known");
    if (status == STATUS_OK && ((seed_count > 0 && !seed) || (sensitivity_count > 0 && !sensitivity)))
        status = instance_error(instance, "the array of seeds or of sensitivities is NULL");
    for (size_t i = 0; i < seed_count && status == STATUS_OK; i++)
        if (!isfinite(seed[i]))
            status = instance_refuse(instance, "seed %zu = %.10g: must be finite", i + 1, seed[i]);
    if (status == STATUS_OK && (instance->now.state & BEFORE_START)) {
        instance_start_rate(instance);
        status = instance_start_attitude(instance);
    }
    if (status == STATUS_OK) status = instance_check_attitude(instance);
    if (status == STATUS_OK) status = composite_refresh(instance);
    if (status == STATUS_OK) status = field_check(instance);
    if (status == STATUS_OK) status = actions_check(instance);
    if (status == STATUS_OK) composite_refresh_axes(instance);
    if (status == STATUS_OK) changes_mirror(instance);
    return status;
}

/* Whether all that derivatives are made of, the seeds included, surely is within the range of doubles. */
static bool derives_ordinary(Instance *instance, const double seed[], size_t count) {
    const double *s = &instance->now.values[REFERENCE_ATTITUDE_START];
    const bool at_start = instance->now.state & BEFORE_START;
    const bool long_enough = fmax(fmax(fabs(s[0]), fabs(s[1])), fmax(fabs(s[2]), fabs(s[3]))) >= 0x1p-150;
    const double *p = instance->now.p, *set = &instance->now.values[REFERENCE_P];
    const bool scaled = memcmp(p, set, INPUT_P_COUNT * sizeof(double)) != 0;
    const bool changed = CHANGES && memcmp(p, instance->now.stepped_p, INPUT_P_COUNT * sizeof(double)) != 0;
    return instance_is_ordinary(instance) && are_within(seed, count, ORDINARY) && !scaled && !changed &&
           (!at_start || (are_within(s, 4, ORDINARY) && long_enough));
}

/* Applies the derivative of q = s/|s| to a vector in place; it is symmetric, so it serves both ways. */
static void project_attitude_start(Instance *instance, double v[4]) {
    const double *q = instance_x(instance), *s = &instance->now.values[REFERENCE_ATTITUDE_START];
    const double length = fabs(s[0] * q[0] + s[1] * q[1] + s[2] * q[2] + s[3] * q[3]);
    const double along = q[0] * v[0] + q[1] * v[1] + q[2] * v[2] + q[3] * v[3];
    for (size_t i = 0; i < 4; i++) v[i] = (v[i] - q[i] * along) / length;
}

/* Where the variation of a variable stands, or NULL: time changes nothing. Start parameters vary the state that they
   become, the angular velocity's three before the attitude's four, those of wheels after them. */
static double *place(Variation *v, unsigned reference) {
    switch (VARIABLES[reference].role) {
        case ROLE_INPUT:
            return &v->inputs[reference - REFERENCE_P];
        case ROLE_PARAMETER:
            if (STATE_COUNT > 7 && reference >= REFERENCE_ATTITUDE_START + 4)
                return &v->x[7 + reference - (REFERENCE_ATTITUDE_START + 4)];
            return reference < REFERENCE_ATTITUDE_START ? &v->x[4 + reference - REFERENCE_RATE_START]
                                                        : &v->x[reference - REFERENCE_ATTITUDE_START];
        case ROLE_STATE: return &v->x[reference - REFERENCE_STATES];
        case ROLE_DERIVATIVE: return &v->rate[reference - REFERENCE_DERIVATIVES];
        case ROLE_OUTPUT: return &v->y[reference - REFERENCE_OUTPUTS];
        default: return NULL;
    }
}

/* The same for a known, by which alone start parameters come here. */
static double *place_of_known(const Instance *instance, Variation *v, unsigned reference) {
    const bool counts = VARIABLES[reference].role != ROLE_PARAMETER || (instance->now.state & BEFORE_START);
    return counts ? place(v, reference) : NULL;
}

/* From changes of x, u, c to changes of rate and y. ordinary: as of instance_call. */
static void respond(Instance *instance, bool ordinary) {
    Variation *v = &instance->scratch.variation;
    instance_set_state_arguments(instance);
    instance->arg[4] = v->x;
    instance->arg[5] = v->inputs + INPUT_P_COUNT + INPUT_K_COUNT;
    instance->arg[6] = v->c;
    instance->res[0] = v->rate;
    instance->res[1] = v->y;
    instance_call(instance, response_forward, ordinary);
}

/* Refuses derivatives that leave the range of doubles. */
static Status check_results(Instance *instance, const unsigned references[], size_t count, const double results[]) {
    for (size_t i = 0; i < count; i++)
        if (!isfinite(results[i]))
            return instance_refuse(instance, "the derivative at %s leaves the range of finite numbers",
                                   VARIABLES[references[i]].name);
    return STATUS_OK;
}

static Status forward(Instance *instance, const unsigned unknowns[], size_t unknown_count, const unsigned knowns[],
                      size_t known_count, const double seed[], double sensitivity[]) {
    Status status = STATUS_OK;
    Variation *v = &instance->scratch.variation;
    memset(v, 0, sizeof *v);
    bool shape_changes = false;
    for (size_t i = 0; i < known_count; i++) {
        double *change = place_of_known(instance, v, knowns[i]);
        if (change) *change += seed[i];
        shape_changes = shape_changes || (knowns[i] < REFERENCE_TORQUE && seed[i] != 0.0);
    }
    const bool at_start = instance->now.state & BEFORE_START;
    if (at_start) project_attitude_start(instance, v->x);
    if (shape_changes) {
        composite_scale_variation(instance, v->inputs);
        instance->arg[0] = instance->now.p;
        instance->arg[1] = v->inputs;
        instance->res[0] = v->c;
        composite_forward(instance->arg, instance->res, instance->iw, instance->w, 0);
    }
    if (at_start) changes_start_forward(instance, v);
    if (shape_changes) status = changes_forward(instance, v);
    if (status != STATUS_OK) return status;
    respond(instance, true);
    if (HANDED_COUNT && shape_changes) status = hand_over_forward(instance, v);
    for (size_t i = 0; i < unknown_count; i++) sensitivity[i] = *place(v, unknowns[i]);
    return status;
}

Status derivatives_forward(Instance *instance, const unsigned unknowns[], size_t unknown_count,
                           const unsigned knowns[], size_t known_count, const double seed[], double sensitivity[]) {
    Status status = check_request(instance, unknowns, unknown_count, knowns, known_count, seed, sensitivity,
                                  known_count, unknown_count);
    if (status != STATUS_OK) return status;
    fenv_t importers;
    const bool ordinary = derives_ordinary(instance, seed, known_count);
    if (!ordinary) feholdexcept(&importers); /* see instance_call */
    status = forward(instance, unknowns, unknown_count, knowns, known_count, seed, sensitivity);
    if (!ordinary) fesetenv(&importers);
    return status == STATUS_OK ? check_results(instance, unknowns, unknown_count, sensitivity) : status;
}

/* Adds to the weights on the inputs those of the states, and of what is handed over, that follow from a change of them. */
static Status weigh_changes(Instance *instance, Variation *v) {
    const Status status = changes_reverse(instance, v);
    return HANDED_COUNT && status == STATUS_OK ? hand_over_reverse(instance, v) : status;
}

static Status adjoint(Instance *instance, const unsigned unknowns[], size_t unknown_count, const unsigned knowns[],
                      size_t known_count, const double seed[], double sensitivity[]) {
    Variation *v = &instance->scratch.variation;
    double on_states[STATE_COUNT];
    memset(v, 0, sizeof *v);
    for (size_t i = 0; i < unknown_count; i++) *place(v, unknowns[i]) += seed[i];
    memcpy(on_states, v->x, sizeof on_states);
    instance_set_state_arguments(instance);
    instance->arg[4] = v->rate;
    instance->arg[5] = v->y;
    instance->res[0] = v->x;
    instance->res[1] = v->inputs + INPUT_P_COUNT + INPUT_K_COUNT;
    instance->res[2] = v->c;
    response_reverse(instance->arg, instance->res, instance->iw, instance->w, 0);
    if (instance->now.state & BEFORE_START) {
        for (size_t i = 0; i < STATE_COUNT; i++) v->x[i] += on_states[i];
        changes_start_reverse(instance, v);
        project_attitude_start(instance, v->x);
    }
    instance->arg[0] = instance->now.p;
    instance->arg[1] = v->c;
    instance->res[0] = v->inputs;
    composite_reverse(instance->arg, instance->res, instance->iw, instance->w, 0);
    const Status status = weigh_changes(instance, v);
    if (status != STATUS_OK) return status;
    composite_scale_variation(instance, v->inputs);
    for (size_t i = 0; i < known_count; i++) {
        const double *weight = place_of_known(instance, v, knowns[i]);
        sensitivity[i] = weight ? *weight : 0.0;
    }
    return status;
}

Status derivatives_adjoint(Instance *instance, const unsigned unknowns[], size_t unknown_count,
                           const unsigned knowns[], size_t known_count, const double seed[], double sensitivity[]) {
    Status status = check_request(instance, unknowns, unknown_count, knowns, known_count, seed, sensitivity,
                                  unknown_count, known_count);
    if (status != STATUS_OK) return status;
    fenv_t importers;
    const bool ordinary = derives_ordinary(instance, seed, unknown_count);
    if (!ordinary) feholdexcept(&importers);
    status = adjoint(instance, unknowns, unknown_count, knowns, known_count, seed, sensitivity);
    if (!ordinary) fesetenv(&importers);
    return status == STATUS_OK ? check_results(instance, knowns, known_count, sensitivity) : status;
}

Status derivatives_of_time(Instance *instance, const unsigned references[], size_t count, const int orders[],
                           double values[]) {
    Status status = check_roles(instance, references, count, 1u << ROLE_OUTPUT, "differentiated: only outputs");
    if (status == STATUS_OK && count > 0 && (!orders || !values))
        status = instance_error(instance, "the array of orders or of values is NULL");
    for (size_t i = 0; i < count && status == STATUS_OK; i++)
        if (orders[i] != 1)
            status = instance_error(instance, "order %d of %s: only the first derivative is known", orders[i],
                                    VARIABLES[references[i]].name);
    double rates[STATE_COUNT];
    if (status == STATUS_OK) status = instance_get_rates(instance, rates, STATE_COUNT);
    if (status != STATUS_OK) return status;
    composite_refresh_axes(instance);
    Variation *v = &instance->scratch.variation;
    memset(v, 0, sizeof *v);
    memcpy(v->x, rates, sizeof rates);
    field_vary(instance, &v->inputs[INPUT_P_COUNT + INPUT_K_COUNT]);
    respond(instance, instance_is_ordinary(instance) && are_within(v->x, STATE_COUNT, ORDINARY));
    for (size_t i = 0; i < count; i++) values[i] = v->y[references[i] - REFERENCE_OUTPUTS];
    return check_results(instance, references, count, values);
}
