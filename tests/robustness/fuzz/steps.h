/* Steps of co-simulation, and derivatives. */
#ifndef FUZZ_STEPS_H
#define FUZZ_STEPS_H

#include "functions.h"

/* Steps. */

static double step_size(void) {
    static const double odd[] = {0.0, -0.0, -1.0, 5e-324, 1e-300, 1e-9, 1e300, DBL_MAX, DBL_EPSILON};
    if (once_in(200)) return no_number();
    return once_in(30) ? odd[below(sizeof odd / sizeof odd[0])] : uniform(1e-3, 2.0);
}

static Answer step(Slot *slot) {
    const double size = step_size();
    const double time = !once_in(60) ? slot->now.time : once_in(2) ? no_number() : slot->now.time + 1e6;
    const bool right = size > 0.0 && isfinite(time + size) && time == slot->now.time;
    Answer answer = {OK, AN_ERROR};
    if (slot->now.state == STEPPING && right) answer.expected = slot->now.stops ? ANYTHING : NO_ERROR;
#if FMI == 3
    bool flags[3] = {true, true, true};
    double last = -1.0;
    const unsigned missing = once_in(60) ? below(4) : 4;
    if (missing < 4 || slot->now.state != STEPPING) answer.expected = AN_ERROR;
    called = "fmi3DoStep";
    answer.status = (int)fmi3DoStep(slot->component, time, size, once_in(2), missing == 0 ? NULL : &flags[0],
                                    missing == 1 ? NULL : &flags[1], missing == 2 ? NULL : &flags[2],
                                    missing == 3 ? NULL : &last);
    if (answer.status <= DISCARD) {
        const bool early = flags[2];
        const double end = answer.status == OK ? time + size : time;
        if (flags[0] || flags[1]) fail("a step asks for an event or an end", slot, answer.status);
        if (early ? !(slot->early_allowed && slot->listens && last >= time && last <= end) : last != end)
            fail("a step did not end where it says", slot, answer.status);
        note_values(&last, 1);
        if (answer.status == OK) slot->now.time = last;
    }
#else
    called = "fmi2DoStep";
    if (slot->now.state != STEPPING) answer.expected = AN_ERROR;
    if (answer.expected == NO_ERROR) answer.expected = ANYTHING; /* to values that cannot be used */
    answer.status = (int)fmi2DoStep(slot->component, time, size, once_in(2));
    if (answer.status == OK) slot->now.time = time + size;
#endif
    steps_taken += answer.status == OK;
    return answer;
}

#if FMI == 2
static Answer step_status(Slot *slot) {
    double last = -1.0;
    const int kind = (int)below(5);
    const bool null = once_in(40);
    called = "fmi2GetRealStatus";
    Answer answer = {OK, expect_of(slot, false, STEPPING | TERMINATED, true)};
    if (answer.expected == ANYTHING && kind == (int)fmi2LastSuccessfulTime) answer.expected = null ? AN_ERROR : FINE;
    else if (answer.expected == ANYTHING) answer.expected = A_DISCARD;
    answer.status = (int)fmi2GetRealStatus(slot->component, (fmi2StatusKind)kind, null ? NULL : &last);
    if (answer.status == OK && slot->now.state == STEPPING && last != slot->now.time)
        fail("the last successful time is not the instance's", slot, OK);
    return answer;
}
#endif

/* Derivatives. */

static unsigned unknown_reference(const Slot *slot) {
    if (once_in(200)) return any_reference();
    if ((slot->now.state & BEFORE_START) && once_in(3)) return reference_of(ROLE_STATE);
    return reference_of(once_in(3) ? ROLE_DERIVATIVE : ROLE_OUTPUT);
}

static unsigned known_reference(const Slot *slot) {
    if (once_in(200)) return any_reference();
    if (once_in(20)) return REFERENCE_TIME;
    if (once_in(2)) return reference_of(slot->now.state & BEFORE_START ? ROLE_PARAMETER : ROLE_STATE);
    return reference_of(ROLE_INPUT);
}

static bool differentiable(const Slot *slot, unsigned reference, bool unknown) {
    const bool before = (slot->now.state & BEFORE_START) != 0;
    if (reference >= VARIABLE_COUNT || is_boolean(reference)) return false;
    switch (VARIABLES[reference].role) {
        case ROLE_TIME:
        case ROLE_INPUT:
        case ROLE_PARAMETER: return !unknown;
        case ROLE_STATE: return unknown == before;
        default: return unknown;
    }
}

static int ask_derivative(Slot *slot, bool adjoint, const unsigned *unknowns, size_t unknown_count,
                          const unsigned *knowns, size_t known_count, const double *seeds, size_t seed_count,
                          double *results, size_t result_count) {
#if FMI == 3
    called = adjoint ? "fmi3GetAdjointDerivative" : "fmi3GetDirectionalDerivative";
    return (int)(adjoint ? fmi3GetAdjointDerivative : fmi3GetDirectionalDerivative)(
        slot->component, unknowns, unknown_count, knowns, known_count, seeds, seed_count, results, result_count);
#else
    (void)adjoint, (void)seed_count, (void)result_count;
    called = "fmi2GetDirectionalDerivative";
    return (int)fmi2GetDirectionalDerivative(slot->component, unknowns, unknown_count, knowns, known_count, seeds,
                                             results);
#endif
}

static Answer derivative(Slot *slot) {
    const bool adjoint = FMI == 3 && once_in(2), null = once_in(60), long_seed = FMI == 3 && once_in(60);
    const size_t unknown_count = below(6), known_count = below(6);
    const size_t seed_count = adjoint ? unknown_count : known_count, result_count = unknown_count + known_count - seed_count;
    unsigned *unknowns = array(unknown_count, sizeof *unknowns), *knowns = array(known_count, sizeof *knowns);
    double *seeds = array(seed_count, sizeof *seeds), *results = array(result_count, sizeof *results);
    bool right = !long_seed && !(null && seed_count > 0), finite = true;
    for (size_t i = 0; i < unknown_count; i++) {
        unknowns[i] = unknown_reference(slot);
        right = right && differentiable(slot, unknowns[i], true);
    }
    for (size_t i = 0; i < known_count; i++) {
        knowns[i] = known_reference(slot);
        right = right && differentiable(slot, knowns[i], false);
    }
    for (size_t i = 0; i < seed_count; i++) {
        seeds[i] = once_in(100) ? no_number() : once_in(20) ? odd_number() : uniform(-1.0, 1.0);
        finite = finite && isfinite(seeds[i]);
    }
    Answer answer = {OK, expect(slot, INITIALIZATION | RUNNING | TERMINATED, right)};
    if (answer.expected == NO_ERROR && !finite) answer.expected = A_DISCARD;
    answer.status = ask_derivative(slot, adjoint, unknowns, unknown_count, knowns, known_count, null ? NULL : seeds,
                                   seed_count + long_seed, results, result_count);
    if (answer.status == OK) note_values(results, result_count);
    for (size_t i = 0; i < result_count && answer.status == OK; i++)
        if (!isfinite(results[i])) fail("a derivative is not finite", slot, OK);
    free(unknowns);
    free(knowns);
    free(seeds);
    free(results);
    return answer;
}

static Answer output_derivative(Slot *slot) {
    const size_t count = below(6);
    unsigned *references = array(count, sizeof *references);
    int32_t *orders = array(count, sizeof *orders);
    double *values = array(count, sizeof *values);
    bool right = true;
    for (size_t i = 0; i < count; i++) {
        references[i] = once_in(60) ? any_reference() : reference_of(ROLE_OUTPUT);
        orders[i] = once_in(60) ? (int32_t)below(4) - 1 : 1;
        right = right && references[i] < VARIABLE_COUNT && VARIABLES[references[i]].role == ROLE_OUTPUT && orders[i] == 1;
    }
    Answer answer = {OK, expect_of(slot, false, STEPPING | TERMINATED, right)};
#if FMI == 3
    called = "fmi3GetOutputDerivatives";
    answer.status = (int)fmi3GetOutputDerivatives(slot->component, references, count, orders, values, count);
#else
    called = "fmi2GetRealOutputDerivatives";
    answer.status = (int)fmi2GetRealOutputDerivatives(slot->component, references, count, orders, values);
#endif
    if (answer.status == OK) note_values(values, count);
    free(references);
    free(orders);
    free(values);
    return answer;
}

#endif
