/* Getting and setting variables by value reference.

   Owns now.values: inputs and parameters as they were set, outputs, states and rates once they are asked for. A get
   makes current what it reads and no more, so that a composite that cannot be computed spoils only what follows from
   it. Needs of the model: outputs, ode. */
#include "variables.h"

#include <math.h>
#include <string.h>

#include "actions.h"
#include "changes.h"
#include "field.h"
#include "hand_over.h"
#include "model.h"

/* Squares of the attitude's length beyond which it cannot be brought to unit length. */
static const double SMALLEST_SQUARE = 1e-200;
static const double LARGEST_SQUARE = 1e200;

Status instance_unknown_reference(Instance *instance, unsigned reference) {
    return instance_error(instance, "value reference %u is unknown; the largest is %d", reference, VARIABLE_COUNT - 1);
}

static Status error_boolean(Instance *instance, unsigned reference) {
    return instance_error(instance, "%s is a Boolean, not a number", VARIABLES[reference].name);
}

Status instance_check_references(Instance *instance, const unsigned references[], size_t count) {
    if (count == 0) return STATUS_OK;
    if (!references) return instance_error(instance, "the array of value references is NULL");
    for (size_t i = 0; i < count; i++)
        if (references[i] >= VARIABLE_COUNT) return instance_unknown_reference(instance, references[i]);
    return STATUS_OK;
}

Status instance_check_attitude(Instance *instance) {
    changes_mirror(instance);
    const double *q = instance_x(instance);
    const double square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    const Variable *attitude = &VARIABLES[REFERENCE_STATES];
    if (!(square >= SMALLEST_SQUARE && square <= LARGEST_SQUARE))
        return instance_refuse(instance, "%.*s = (%.10g, %.10g, %.10g, %.10g): its length must be about 1",
                               group_length(attitude), attitude->name, q[0], q[1], q[2], q[3]);
    return STATUS_OK;
}

bool are_within(const double numbers[], size_t count, double limit) {
    bool within = true;
    /* islessequal, unlike <=, raises no floating-point exception for a NaN, whoever the compiler is */
    for (size_t i = 0; i < count; i++) within = within && islessequal(fabs(numbers[i]), limit);
    return within;
}

bool instance_is_ordinary(Instance *instance) {
    return instance->now.composite_is_ordinary && are_within(instance_x(instance), STATE_COUNT, ORDINARY) &&
           (!STATE_IS_MOMENTUM || are_within(instance_states(instance), STATE_COUNT, ORDINARY)) &&
           are_within(&instance->now.values[REFERENCE_TORQUE], INPUT_U_COUNT, ORDINARY) && field_is_ordinary(instance);
}

static Status refresh_outputs(Instance *instance) {
    if (instance->outputs_are_current) return STATUS_OK;
    const Status status = instance_check_attitude(instance);
    if (status != STATUS_OK) return status;
    instance_set_arguments(instance);
    instance->res[0] = &instance->now.values[REFERENCE_OUTPUTS];
    instance_call(instance, outputs, instance_is_ordinary(instance));
    hand_over_show(instance);
    instance->outputs_are_current = true;
    return STATUS_OK;
}

static Status refresh_rates(Instance *instance) {
    if (instance->rates_are_current) return STATUS_OK;
    changes_mirror(instance);
    instance_set_state_arguments(instance);
    instance->res[0] = instance_rates(instance);
    instance_call(instance, ode, instance_is_ordinary(instance));
    instance->rates_are_current = true;
    return STATUS_OK;
}

/* Makes what is asked for follow from state and inputs. A composite that cannot be computed spoils only what
   follows from it. */
static Status prepare(Instance *instance, unsigned wanted) {
    Status status = STATUS_OK;
    if (instance->now.state & BEFORE_START) {
        if (wanted & FOLLOWS_STATES) instance_start_rate(instance);
        if (wanted & FOLLOWS_ATTITUDE) status = instance_start_attitude(instance);
    }
    if (status == STATUS_OK && (wanted & FOLLOWS_COMPOSITE)) status = composite_refresh(instance);
    if (status == STATUS_OK && (wanted & FOLLOWS_STATES)) changes_mirror(instance);
    if (status == STATUS_OK && (wanted & FOLLOWS_AXES)) composite_refresh_axes(instance);
    if (status == STATUS_OK && (wanted & FOLLOWS_FIELD)) status = field_check(instance);
    if (status == STATUS_OK && (wanted & FOLLOWS_OUTPUTS)) status = refresh_outputs(instance);
    if (status == STATUS_OK && (wanted & FOLLOWS_RATES)) status = field_check(instance);
    if (status == STATUS_OK && (wanted & FOLLOWS_RATES)) status = actions_check(instance);
    if (status == STATUS_OK && (wanted & FOLLOWS_RATES)) status = refresh_rates(instance);
    return status;
}

static Status beyond_range(Instance *instance, size_t reference) {
    return instance_refuse(instance, "%s leaves the range of finite numbers", VARIABLES[reference].name);
}

/* What must be current before a variable is read. In continuous time inputs leave the states as they are. */
static unsigned follows(const Instance *instance, unsigned reference) {
    const unsigned all = VARIABLES[reference].follows;
    const bool is_state = CHANGES && VARIABLES[reference].role == ROLE_STATE;
    return is_state && changes_state(instance) == CONTINUOUS ? all & ~(unsigned)FOLLOWS_COMPOSITE : all;
}

Status instance_get(Instance *instance, const unsigned references[], size_t count, double values[]) {
    if (count == 0) return STATUS_OK;
    if (!references || !values) return instance_error(instance, "an array is NULL");
    unsigned wanted = 0;
    for (size_t i = 0; i < count; i++) {
        if (references[i] >= VARIABLE_COUNT) return instance_unknown_reference(instance, references[i]);
        if (is_boolean(references[i])) return error_boolean(instance, references[i]);
        wanted |= follows(instance, references[i]);
    }
    const Status status = prepare(instance, wanted);
    if (status != STATUS_OK) return status;
    for (size_t i = 0; i < count; i++) {
        values[i] = instance->now.values[references[i]];
        if (!isfinite(values[i])) return beyond_range(instance, references[i]);
    }
    return STATUS_OK;
}

static Status check_settable(Instance *instance, const Variable *variable) {
    switch (variable->role) {
        case ROLE_INPUT: return STATUS_OK;
        case ROLE_PARAMETER:
            if (instance->now.state & BEFORE_START) return STATUS_OK;
            return instance_error(instance, "%s is a fixed parameter and cannot be set after initialisation",
                                  variable->name);
        case ROLE_OUTPUT: return instance_error(instance, "%s is an output and cannot be set", variable->name);
        case ROLE_STATE: /* beside SetContinuousStates: CasADi's importer sets states by reference */
            if (instance->now.model_exchange && (instance->now.state & (EVENT | CONTINUOUS))) return STATUS_OK;
            if (instance->now.state == INSTANTIATED) return STATUS_OK; /* a guess, see instance_set */
            return instance_error(instance, "%s is a state: it can be set in model exchange once it runs",
                                  variable->name);
        case ROLE_DERIVATIVE:
            return instance_error(instance, "%s is a local variable and cannot be set", variable->name);
        default: return instance_error(instance, "%s is the independent variable and cannot be set", variable->name);
    }
}

static Status refuse_not_finite(Instance *instance, const Variable *variable, double value) {
    return instance_refuse(instance, "%s = %.10g%s%s: must be finite", variable->name, value,
                           variable->unit[0] ? " " : "", variable->unit);
}

/* Inputs stand together: those of the composite, the motion at contact, what acts; the parameters follow. */
static bool is_input(unsigned reference) {
    return reference >= REFERENCE_P && reference < REFERENCE_TORQUE + INPUT_U_COUNT;
}

/* Whether a value may be stored: known, settable in this state, finite. */
static Status check_set(Instance *instance, unsigned reference, double value) {
    if (reference >= VARIABLE_COUNT) return instance_unknown_reference(instance, reference);
    if (is_boolean(reference)) return error_boolean(instance, reference);
    const Variable *variable = &VARIABLES[reference];
    if (variable->role != ROLE_INPUT) {
        const Status status = check_settable(instance, variable);
        if (status != STATUS_OK) return status;
    }
    if (isfinite(value)) return STATUS_OK;
    return refuse_not_finite(instance, variable, value);
}

static bool hold_states(const unsigned references[], size_t count) {
    bool held = false;
    for (size_t i = 0; i < count; i++) held = held || references[i] >= REFERENCE_STATES;
    return held;
}

/* Before initialisation a state may be guessed (initial = "approx"); nothing is searched for that begins from a guess:
   what a flight starts from are the start parameters. */
static bool is_guess(const Instance *instance, unsigned reference) {
    return instance->now.state == INSTANTIATED && VARIABLES[reference].role == ROLE_STATE;
}

/* States that are set in event mode go with the inputs set before them: those are judged, and make their change. */
static Status before_states(Instance *instance) {
    return CHANGES && instance->now.state == EVENT ? composite_refresh(instance) : STATUS_OK;
}

/* What is set after them makes a change that begins from them. */
static void after_states(Instance *instance) {
    instance_state_moved(instance);
    if (instance->now.state == EVENT) changes_commit(instance);
}

Status instance_set(Instance *instance, const unsigned references[], size_t count, const double values[]) {
    if (count == 0) return STATUS_OK;
    if (!references || !values) return instance_error(instance, "an array is NULL");
    for (size_t i = 0; i < count; i++) {
        if (is_input(references[i]) && !is_boolean(references[i]) && isfinite(values[i])) continue;
        const Status status = check_set(instance, references[i], values[i]);
        if (status != STATUS_OK) return status;
    }
    const bool holds_states = CHANGES && (instance->now.state & (EVENT | CONTINUOUS)) && hold_states(references, count);
    const Status status = holds_states ? before_states(instance) : STATUS_OK;
    if (status != STATUS_OK) return status;
    bool changed = false, shape_changed = false;
    for (size_t i = 0; i < count; i++) {
        double *value = &instance->now.values[references[i]];
        field_set(instance, references[i]);
        if (*value == values[i] || is_guess(instance, references[i])) continue;
        *value = values[i];
        changed = true;
        shape_changed = shape_changed || references[i] < REFERENCE_TORQUE;
    }
    if (holds_states) after_states(instance);
    if (changed) instance->outputs_are_current = instance->rates_are_current = false;
    if (shape_changed) instance->now.composite_is_current = false;
    return STATUS_OK;
}

Status instance_set_time(Instance *instance, double time) {
    if (!isfinite(time)) return instance_refuse(instance, "time = %.10g s: must be finite", time);
    instance->now.values[REFERENCE_TIME] = time;
    if (HANDED_COUNT) instance->outputs_are_current = false;
    return STATUS_OK;
}

static Status check_states(Instance *instance, const void *array, size_t count) {
    if (!array) return instance_error(instance, "the array is NULL");
    if (count != STATE_COUNT)
        return instance_error(instance, "the array has %zu elements: must be %d", count, STATE_COUNT);
    return STATUS_OK;
}

Status instance_get_states(Instance *instance, double states[], size_t count) {
    Status status = check_states(instance, states, count);
    const unsigned wanted = CHANGES ? follows(instance, REFERENCE_STATES + 4) : FOLLOWS_STATES;
    if (status == STATUS_OK) status = prepare(instance, wanted | FOLLOWS_ATTITUDE);
    if (status == STATUS_OK) memcpy(states, instance_states(instance), STATE_COUNT * sizeof(double));
    return status;
}

Status instance_set_states(Instance *instance, const double states[], size_t count) {
    Status status = check_states(instance, states, count);
    if (status != STATUS_OK) return status;
    for (size_t i = 0; i < STATE_COUNT; i++)
        if (!isfinite(states[i]))
            return refuse_not_finite(instance, &VARIABLES[REFERENCE_STATES + i], states[i]);
    status = before_states(instance);
    if (status != STATUS_OK) return status;
    memcpy(instance_states(instance), states, STATE_COUNT * sizeof(double));
    after_states(instance);
    return STATUS_OK;
}

Status instance_get_rates(Instance *instance, double rates[], size_t count) {
    Status status = check_states(instance, rates, count);
    if (status == STATUS_OK)
        status = prepare(instance, FOLLOWS_STATES | FOLLOWS_ATTITUDE | FOLLOWS_COMPOSITE | FOLLOWS_RATES);
    for (size_t i = 0; i < STATE_COUNT && status == STATUS_OK; i++) {
        rates[i] = instance_rates(instance)[i];
        if (!isfinite(rates[i])) status = beyond_range(instance, REFERENCE_DERIVATIVES + i);
    }
    return status;
}

Status instance_get_nominals(Instance *instance, double nominals[], size_t count) {
    const Status status = check_states(instance, nominals, count);
    for (size_t i = 0; i < STATE_COUNT && status == STATUS_OK; i++)
        nominals[i] = VARIABLES[REFERENCE_STATES + i].nominal;
    return status;
}
