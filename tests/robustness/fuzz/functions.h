/* FMI functions that calls and rules share, the log that they write, and what a call must be answered with. */
#ifndef FUZZ_FUNCTIONS_H
#define FUZZ_FUNCTIONS_H

#include "draws.h"

/* The log. */

static void logged(Slot *slot, int status, const char *category, const char *message) {
    if (status <= WARNING) return;
    const size_t length = strlen(called);
    slot->lines++;
    slot->line_status = status;
    snprintf(last_line, sizeof last_line, "%s", message);
    slot->line_named = strncmp(message, called, length) == 0 && message[length] == ':' && strlen(message) < 1024 &&
                       strcmp(category, status == ERROR ? "logStatusError" : "logStatusDiscard") == 0;
}

#if FMI == 3
static void log_message(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String text) {
    logged(environment, (int)status, category, text);
}
#else
static void log_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                        fmi2String text, ...) {
    (void)name;
    logged(environment, (int)status, category, text);
}
#endif

/* Functions that the checks use too. */

static int get_values(Slot *slot, const unsigned references[], size_t count, double values[], size_t value_count) {
    called = EITHER("fmi2GetReal", "fmi3GetFloat64");
    (void)value_count;
#if FMI == 3
    return (int)fmi3GetFloat64(slot->component, references, count, values, value_count);
#else
    return (int)fmi2GetReal(slot->component, references, count, values);
#endif
}

static int set_values(Slot *slot, const unsigned references[], size_t count, const double values[],
                      size_t value_count) {
    called = EITHER("fmi2SetReal", "fmi3SetFloat64");
    (void)value_count;
#if FMI == 3
    return (int)fmi3SetFloat64(slot->component, references, count, values, value_count);
#else
    return (int)fmi2SetReal(slot->component, references, count, values);
#endif
}

#if DOCK_COUNT

typedef EITHER(fmi2Boolean, fmi3Boolean) Boolean;

static int get_booleans(Slot *slot, const unsigned references[], size_t count, Boolean values[], size_t value_count) {
    called = EITHER("fmi2GetBoolean", "fmi3GetBoolean");
    (void)value_count;
#if FMI == 3
    return (int)fmi3GetBoolean(slot->component, references, count, values, value_count);
#else
    return (int)fmi2GetBoolean(slot->component, references, count, values);
#endif
}

static int set_booleans(Slot *slot, const unsigned references[], size_t count, const Boolean values[],
                        size_t value_count) {
    called = EITHER("fmi2SetBoolean", "fmi3SetBoolean");
    (void)value_count;
#if FMI == 3
    return (int)fmi3SetBoolean(slot->component, references, count, values, value_count);
#else
    return (int)fmi2SetBoolean(slot->component, references, count, values);
#endif
}

#endif

static int save(Slot *slot, void **saved) {
    called = EITHER("fmi2GetFMUstate", "fmi3GetFMUState");
    return (int)EITHER(fmi2GetFMUstate, fmi3GetFMUState)(slot->component, saved);
}

static int restore(Slot *slot, void *saved) {
    called = EITHER("fmi2SetFMUstate", "fmi3SetFMUState");
    return (int)EITHER(fmi2SetFMUstate, fmi3SetFMUState)(slot->component, saved);
}

static int reset(Slot *slot) {
    called = EITHER("fmi2Reset", "fmi3Reset");
    return (int)EITHER(fmi2Reset, fmi3Reset)(slot->component);
}

static void free_state(Slot *slot, void **saved) {
    called = EITHER("fmi2FreeFMUstate", "fmi3FreeFMUState");
    if ((int)EITHER(fmi2FreeFMUstate, fmi3FreeFMUState)(slot->component, saved) != OK || *saved)
        fail("a state cannot be freed", slot, ERROR);
}

/* What is expected of a call that is allowed in some states, with arguments that are right or not. */
static Expected expect(const Slot *slot, unsigned states, bool right) {
    if (!(slot->now.state & states) || !right) return AN_ERROR;
    return FMI == 3 ? NO_ERROR : ANYTHING;
}

/* The same for a function of one interface. */
static Expected expect_of(const Slot *slot, bool exchange, unsigned states, bool right) {
    return expect(slot, slot->exchange == exchange ? states : 0, right);
}

#endif
