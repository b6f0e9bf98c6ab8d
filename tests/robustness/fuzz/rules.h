/* The rules: what holds after whatever call. */
#ifndef FUZZ_RULES_H
#define FUZZ_RULES_H

#include "functions.h"

/* Whether a variable reads the same in this state before and after a call that was not answered with OK. */
static bool comparable(unsigned state, bool ended, unsigned reference) {
    const Role role = VARIABLES[reference].role;
    if (role == ROLE_TIME || role == ROLE_INPUT || role == ROLE_PARAMETER) return true;
    return !(state & BEFORE_START) || !ended;
}

static void read_all(Slot *slot, unsigned state, bool ended, double values[]) {
    for (unsigned i = 0; i < VARIABLE_COUNT; i++) {
        values[i] = 0.0;
#if DOCK_COUNT
        Boolean value = 0;
        if (is_boolean(i)) {
            values[i] = get_booleans(slot, &i, 1, &value, 1) != OK ? -12345.0 : value ? 1.0 : 0.0;
            continue;
        }
#endif
        if (comparable(state, ended, i) && get_values(slot, &i, 1, &values[i], 1) != OK) values[i] = -12345.0;
    }
}

/* After a call that was refused: reads everything, goes back to before the call, reads everything again. */
static void check_unchanged(Slot *slot, const Known *known, int status) {
    double after[VARIABLE_COUNT], before[VARIABLE_COUNT];
    const char *name = called;
    const bool ended = slot->now.state == TERMINATED;
    if (FMI == 2 && known->state == INSTANTIATED) return;
    read_all(slot, known->state, ended, after);
    if (restore(slot, slot->before) != OK) fail("the state before a call cannot be restored", slot, ERROR);
    slot->now = *known;
    read_all(slot, known->state, ended, before);
    called = name;
    for (unsigned i = 0; i < VARIABLE_COUNT; i++) {
        if (memcmp(&after[i], &before[i], sizeof after[i]) == 0) continue;
        fprintf(stderr, "%s was %.17g, is %.17g\n", VARIABLES[i].name, before[i], after[i]);
        fail("a refused call changed a value", slot, status);
    }
}

static void check_ended(Slot *slot) {
    const unsigned reference = REFERENCE_P;
    const double value = VARIABLES[reference].start;
    const char *name = called;
    if (set_values(slot, &reference, 1, &value, 1) != ERROR) fail("an instance goes on after an error", slot, ERROR);
    called = name;
}

/* Whether an error was a broken rule. FMI 2.0 has no Discard for most calls that values keep from their answer: there
   an error that the arguments did not ask for may leave the instance as it was. */
static bool is_ended(Slot *slot, Answer answer) {
    if (FMI == 3 || answer.expected == AN_ERROR) return true;
    const char *name = called;
    const unsigned lines = slot->lines;
    const bool ended = set_values(slot, NULL, 0, NULL, 0) == ERROR;
    slot->lines = lines;
    called = name;
    return ended;
}

static void check_running(Slot *slot) {
    const unsigned references[5] = {attitude_reference, attitude_reference + 1, attitude_reference + 2,
                                    attitude_reference + 3, REFERENCE_TIME};
    double q[5];
    const int status = get_values(slot, references, 5, q, 5);
    if (status != OK && !(slot->exchange && status == DISCARD)) fail("the attitude cannot be read", slot, status);
    if (status != OK) return;
    const double length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(fabs(length - 1.0) <= UNIT_TOLERANCE)) fail("the attitude is not unit", slot, status);
    if (q[4] != slot->now.time) fail("time is not what the importer knows", slot, status);
}

static bool as_expected(Answer answer) {
    switch (answer.expected) {
        case AN_ERROR: return answer.status == ERROR;
        case NO_ERROR: return answer.status != ERROR;
        case A_DISCARD: return answer.status == DISCARD;
        case FINE: return answer.status == OK;
        default: return true;
    }
}

static void check(Slot *slot, Answer answer, const Known *known, unsigned log_mask) {
    const bool refused = answer.status >= DISCARD;
    if (answer.status < OK || answer.status > ERROR) fail("is no status that this FMU answers", slot, answer.status);
    if (slot->inner_error) {
        if (answer.status != ERROR) fail("a step goes on after an error within it", slot, answer.status);
    } else {
        const bool line = (answer.status == DISCARD && (log_mask & 1)) || (answer.status == ERROR && (log_mask & 2));
        if (!as_expected(answer)) fail("is not what its state and arguments ask for", slot, answer.status);
        if (slot->lines != line) fail("a refused call logs one line if asked to, no other one does", slot, answer.status);
        if (line && (slot->line_status != answer.status || !slot->line_named))
            fail("the line has another status or name than the call", slot, answer.status);
    }
    answered[answer.status]++;
    note(&answer.status, sizeof answer.status);
    if (answer.status == ERROR) {
        slot->now = *known;
        if (is_ended(slot, answer)) {
            slot->now.state = TERMINATED;
            check_ended(slot);
        }
    }
    if (refused && !slot->inner_error && once_in(2)) check_unchanged(slot, known, answer.status);
    if ((slot->now.state & RUNNING) && once_in(4)) check_running(slot);
}

#endif
