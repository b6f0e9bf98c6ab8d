/* Time, states and modes of model exchange; modes of co-simulation with events. */
#ifndef FUZZ_EXCHANGE_H
#define FUZZ_EXCHANGE_H

#include "functions.h"

static Answer set_time(Slot *slot) {
    const double time = once_in(30) ? no_number() : slot->now.time + uniform(-1.0, 1.0);
    called = EITHER("fmi2SetTime", "fmi3SetTime");
    Answer answer = {OK, expect_of(slot, true, EXCHANGING, true)};
    answer.status = (int)EITHER(fmi2SetTime, fmi3SetTime)(slot->component, time);
    if (answer.status == OK) slot->now.time = time;
    if ((answer.status == OK) != (slot->exchange && (slot->now.state & EXCHANGING) && isfinite(time)))
        fail("time is set if and only if it is finite", slot, answer.status);
    return answer;
}

static Answer set_states(Slot *slot) {
    const size_t count = once_in(40) ? below(9) : STATE_COUNT;
    const bool null = once_in(60);
    double *values = array(count, sizeof *values);
    bool finite = true;
    for (size_t i = 0; i < count; i++) {
        values[i] = value_for(REFERENCE_STATES);
        finite = finite && isfinite(values[i]);
    }
    called = EITHER("fmi2SetContinuousStates", "fmi3SetContinuousStates");
    Answer answer = {OK, slot->now.state == CONTINUOUS && count == STATE_COUNT && !null ? FINE : AN_ERROR};
    if (answer.expected == FINE && !finite) answer.expected = A_DISCARD;
    answer.status = (int)EITHER(fmi2SetContinuousStates, fmi3SetContinuousStates)(slot->component, null ? NULL : values,
                                                                                  count);
    free(values);
    return answer;
}

static Answer get_states(Slot *slot) {
    const size_t count = once_in(40) ? below(9) : STATE_COUNT;
    const bool null = once_in(60), right = count == STATE_COUNT && !null;
    const unsigned started = INITIALIZATION | EXCHANGING | TERMINATED;
    double *values = array(count, sizeof *values), *given = null ? NULL : values;
    Answer answer = {OK, expect_of(slot, true, started, right)};
    switch (below(3)) {
        case 0:
            called = EITHER("fmi2GetContinuousStates", "fmi3GetContinuousStates");
            answer.status = (int)EITHER(fmi2GetContinuousStates, fmi3GetContinuousStates)(slot->component, given, count);
            break;
        case 1:
            called = EITHER("fmi2GetDerivatives", "fmi3GetContinuousStateDerivatives");
            answer.status = (int)EITHER(fmi2GetDerivatives, fmi3GetContinuousStateDerivatives)(slot->component, given, count);
            break;
        default:
            called = EITHER("fmi2GetNominalsOfContinuousStates", "fmi3GetNominalsOfContinuousStates");
            answer.expected = expect_of(slot, true, ALL, right);
            answer.status = (int)EITHER(fmi2GetNominalsOfContinuousStates, fmi3GetNominalsOfContinuousStates)(
                slot->component, given, count);
    }
    if (answer.status == OK) note_values(values, count);
    free(values);
    return answer;
}

static Answer get_indicators(Slot *slot) {
    double value = 0.0;
    const size_t count = once_in(8);
    called = EITHER("fmi2GetEventIndicators", "fmi3GetEventIndicators");
    Answer answer = {OK, expect_of(slot, true, INITIALIZATION | EXCHANGING | TERMINATED, count == 0)};
    answer.status = (int)EITHER(fmi2GetEventIndicators, fmi3GetEventIndicators)(slot->component, count ? &value : NULL,
                                                                                count);
    return answer;
}

static Answer update_discrete_states(Slot *slot) {
    const bool null = once_in(60);
#if FMI == 3
    bool flags[5] = {true, true, true, true, true};
    double time = 0.0;
    called = "fmi3UpdateDiscreteStates";
    Answer answer = {OK, expect(slot, EVENT, !null)};
    answer.status = (int)fmi3UpdateDiscreteStates(slot->component, &flags[0], &flags[1], null ? NULL : &flags[2],
                                                  &flags[3], &flags[4], &time);
    if (answer.status == OK && (flags[0] || flags[1] || flags[2] || (flags[3] && !CHANGES) || flags[4]))
        fail("an update asks for an event", slot, OK);
#else
    fmi2EventInfo info;
    memset(&info, 1, sizeof info);
    called = "fmi2NewDiscreteStates";
    Answer answer = {OK, expect(slot, EVENT, !null)};
    answer.status = (int)fmi2NewDiscreteStates(slot->component, null ? NULL : &info);
    if (answer.status == OK && (info.newDiscreteStatesNeeded || info.terminateSimulation || info.nextEventTimeDefined))
        fail("an update asks for an event", slot, OK);
#endif
    return answer;
}

#if FMI == 3 && DOCK_COUNT
static Answer step_mode(Slot *slot) {
    Answer answer = {OK, expect_of(slot, false, EVENT, true)};
    called = "fmi3EnterStepMode";
    answer.status = (int)fmi3EnterStepMode(slot->component);
    if (answer.status == OK) slot->now.state = STEPPING;
    return answer;
}
#endif

static Answer change_mode(Slot *slot) {
    Answer answer = {OK, ANYTHING};
    const unsigned before_event = EITHER(EXCHANGING, CONTINUOUS) | (slot->events ? STEPPING : 0);
    const bool wants_event = slot->exchange ? once_in(2) : slot->now.state != EVENT;
    if (!slot->exchange && !slot->events && !once_in(50)) return NOTHING;
#if FMI == 3 && DOCK_COUNT
    if (slot->events && slot->now.state == EVENT ? !once_in(50) : once_in(50)) return step_mode(slot);
    if (slot->events && slot->now.state == STEPPING && !once_in(8)) return NOTHING;
#endif
    if (wants_event) {
        called = EITHER("fmi2EnterEventMode", "fmi3EnterEventMode");
        /* what was set in continuous time is judged there, at the latest */
        const unsigned judged = CHANGES && slot->now.state == CONTINUOUS ? EITHER(ANYTHING, NO_ERROR) : FINE;
        answer.expected = slot->now.state & before_event ? judged : AN_ERROR;
        answer.status = (int)EITHER(fmi2EnterEventMode, fmi3EnterEventMode)(slot->component);
        if (answer.status == OK) slot->now.state = EVENT;
        return answer;
    }
    called = EITHER("fmi2EnterContinuousTimeMode", "fmi3EnterContinuousTimeMode");
    answer.expected = slot->now.state != EVENT || !slot->exchange ? AN_ERROR : !CHANGES ? FINE : EITHER(ANYTHING, NO_ERROR);
    answer.status = (int)EITHER(fmi2EnterContinuousTimeMode, fmi3EnterContinuousTimeMode)(slot->component);
    if (answer.status == OK) slot->now.state = CONTINUOUS;
    return answer;
}

static Answer complete_step(Slot *slot) {
    const bool null = once_in(60);
    EITHER(fmi2Boolean, fmi3Boolean) event = true, end = true;
    called = EITHER("fmi2CompletedIntegratorStep", "fmi3CompletedIntegratorStep");
    Answer answer = {OK, slot->now.state == CONTINUOUS && !null ? FINE : AN_ERROR};
    answer.status = (int)EITHER(fmi2CompletedIntegratorStep, fmi3CompletedIntegratorStep)(
        slot->component, true, &event, null ? NULL : &end);
    if (answer.status == OK && (event || end)) fail("a completed step asks for an event", slot, OK);
    return answer;
}

#endif
