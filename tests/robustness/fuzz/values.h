/* Getting and setting numbers and Booleans. */
#ifndef FUZZ_VALUES_H
#define FUZZ_VALUES_H

#include "functions.h"

static Answer get(Slot *slot) {
    const size_t count = below(MOST), value_count = FMI == 3 && once_in(40) ? count + 1 : count;
    unsigned *references = array(count, sizeof *references);
    double *values = array(count, sizeof *values);
    bool right = value_count == count;
    for (size_t i = 0; i < count; i++) {
        references[i] = any_reference();
        right = right && references[i] < VARIABLE_COUNT && !is_boolean(references[i]);
    }
    const bool no_references = once_in(60), no_values = once_in(60);
    right = right && (count == 0 || !(no_references || no_values));
    Answer answer = {OK, expect(slot, FMI == 3 ? ALL : ALL & ~INSTANTIATED, right)};
    if (FMI == 2 && count == 0 && slot->now.state != INSTANTIATED) answer.expected = FINE;
    answer.status = get_values(slot, no_references ? NULL : references, count, no_values ? NULL : values, value_count);
    if (answer.status == OK) note_values(values, count);
    free(references);
    free(values);
    return answer;
}

static bool settable(const Slot *slot, unsigned reference) {
    if (reference >= VARIABLE_COUNT || is_boolean(reference)) return false;
    switch (VARIABLES[reference].role) {
        case ROLE_INPUT: return true;
        case ROLE_PARAMETER: return (slot->now.state & BEFORE_START) != 0;
        case ROLE_STATE:
            return slot->now.state == INSTANTIATED || (slot->exchange && (slot->now.state & EXCHANGING) != 0);
        default: return false;
    }
}

static unsigned reference_to_set(const Slot *slot) {
    if (once_in(150)) return any_reference();
    if ((slot->now.state & BEFORE_START) && once_in(2)) return reference_of(ROLE_PARAMETER);
    if (slot->exchange && (slot->now.state & EXCHANGING) && once_in(3)) return reference_of(ROLE_STATE);
    return reference_of(ROLE_INPUT);
}

static Answer set(Slot *slot) {
    const size_t count = 1 + below(4), value_count = FMI == 3 && once_in(60) ? count - 1 : count;
    unsigned *references = array(count, sizeof *references);
    double *values = array(count, sizeof *values), back = 0.0;
    bool right = value_count == count, finite = true, judged = false;
    for (size_t i = 0; i < count; i++) {
        references[i] = reference_to_set(slot);
        values[i] = value_for(references[i]);
        /* states go with the inputs set before them */
        judged = judged || (CHANGES && slot->now.state == EVENT && references[i] >= REFERENCE_STATES);
        right = right && settable(slot, references[i]);
        finite = finite && isfinite(values[i]);
    }
    const bool no_references = once_in(60), no_values = once_in(60);
    const bool given = value_count == count && !no_references && !no_values;
    Answer answer = {OK, ANYTHING};
    if (!(slot->now.state & (BEFORE_START | RUNNING)) || !given || (!right && finite)) answer.expected = AN_ERROR;
    else if (right) answer.expected = !finite ? A_DISCARD : judged ? NO_ERROR : FINE;
    answer.status = set_values(slot, no_references ? NULL : references, count, no_values ? NULL : values, value_count);
    if (answer.status == OK && (FMI == 3 || slot->now.state != INSTANTIATED) &&
        VARIABLES[references[count - 1]].role != ROLE_STATE) {
        const char *name = called;
        if (get_values(slot, &references[count - 1], 1, &back, 1) != OK || back != values[count - 1])
            fail("a value that was set does not read back", slot, OK);
        called = name;
    }
    free(references);
    free(values);
    return answer;
}

/* Sets all inputs near the scene's, so that the instance can go on. */
static Answer set_good_inputs(Slot *slot) {
    unsigned references[INPUT_COUNT + 1];
    double values[INPUT_COUNT + 1];
    size_t count = 0;
    for (unsigned i = REFERENCE_P; i < REFERENCE_P + INPUT_COUNT; i++) {
        if (is_boolean(i)) continue;
        references[count] = i;
        values[count++] = VARIABLES[i].start * uniform(0.99, 1.01);
    }
    Answer answer = {OK, slot->now.state & (BEFORE_START | RUNNING) ? FINE : AN_ERROR};
    answer.status = set_values(slot, references, count, values, count);
    return answer;
}

#if DOCK_COUNT

static unsigned boolean_reference(void) {
    unsigned reference = below(VARIABLE_COUNT);
    if (once_in(100)) return any_reference();
    while (!is_boolean(reference)) reference = (reference + 1) % VARIABLE_COUNT;
    return reference;
}

static Answer get_some_booleans(Slot *slot) {
    const size_t count = below(4), value_count = FMI == 3 && once_in(40) ? count + 1 : count;
    unsigned *references = array(count, sizeof *references);
    Boolean *values = array(count, sizeof *values);
    bool right = value_count == count;
    for (size_t i = 0; i < count; i++) {
        references[i] = boolean_reference();
        right = right && is_boolean(references[i]);
    }
    const bool null = once_in(60);
    right = right && (count == 0 || !null);
    Answer answer = {OK, expect(slot, FMI == 3 ? ALL : ALL & ~INSTANTIATED, right)};
    if (answer.expected != AN_ERROR) answer.expected = FINE;
    answer.status = get_booleans(slot, references, count, null ? NULL : values, value_count);
    for (size_t i = 0; i < count && answer.status == OK; i++) {
        const double value = values[i] ? 1.0 : 0.0;
        note_values(&value, 1);
    }
    free(references);
    free(values);
    return answer;
}

/* Opens and closes docks; where that has to wait for an event, mostly sets what is. */
static Answer set_some_booleans(Slot *slot) {
    const size_t count = below(3), value_count = FMI == 3 && once_in(60) ? count + 1 : count;
    const bool held = (slot->now.state & (slot->events ? STEPPING | CONTINUOUS : CONTINUOUS)) != 0;
    const bool null = once_in(60), keep = held && !once_in(10);
    unsigned *references = array(count, sizeof *references);
    Boolean *values = array(count, sizeof *values), back = 0;
    bool right = value_count == count && (count == 0 || !null);
    for (size_t i = 0; i < count; i++) {
        references[i] = boolean_reference();
        right = right && is_boolean(references[i]);
        if (!right) continue;
        values[i] = once_in(3) ? VARIABLES[references[i]].start == 0.0 : VARIABLES[references[i]].start != 0.0;
        if (!held) continue;
        if (get_booleans(slot, &references[i], 1, &back, 1) != OK) fail("a Boolean cannot be read", slot, ERROR);
        if (keep) values[i] = back;
        right = right && !values[i] == !back;
    }
    Answer answer = {OK, expect(slot, BEFORE_START | RUNNING, right)};
    if (answer.expected != AN_ERROR) answer.expected = FINE;
    answer.status = set_booleans(slot, references, count, null ? NULL : values, value_count);
    if (answer.status == OK && count > 0 && (FMI == 3 || slot->now.state != INSTANTIATED)) {
        const char *name = called;
        if (get_booleans(slot, &references[count - 1], 1, &back, 1) != OK || !back != !values[count - 1])
            fail("a Boolean that was set does not read back", slot, OK);
        called = name;
    }
    free(references);
    free(values);
    return answer;
}

#endif

#endif
