/* Instances from instantiation to reset, and what an importer does within a step. */
#ifndef FUZZ_LIFE_CYCLE_H
#define FUZZ_LIFE_CYCLE_H

#include "functions.h"

#if FMI == 3
static int forbidden(Slot *slot) {
    const unsigned reference = REFERENCE_TIME;
    const double value = 0.0;
    switch (below(6)) {
        case 0: return set_values(slot, &reference, 1, &value, 1);
        case 1: return reset(slot);
        case 2: return restore(slot, slot->before);
        case 3: called = "fmi3Terminate"; return (int)fmi3Terminate(slot->component);
        case 4: called = "fmi3ExitInitializationMode"; return (int)fmi3ExitInitializationMode(slot->component);
        default: called = "fmi3EnterEventMode"; return (int)fmi3EnterEventMode(slot->component);
    }
}

/* Reads within a step: the attitude always can be, and any output unless it is beyond all numbers. */
static void read_within_step(Slot *slot) {
    double values[OUTPUT_COUNT];
    unsigned references[OUTPUT_COUNT];
    const unsigned lines = slot->lines, first = once_in(2) ? attitude_reference : (unsigned)REFERENCE_OUTPUTS;
    const size_t count = first == attitude_reference ? 4 : OUTPUT_COUNT;
    for (unsigned i = 0; i < count; i++) references[i] = first + i;
    const int status = get_values(slot, references, count, values, count);
    if (status != OK && !(status == DISCARD && first != attitude_reference))
        fail("outputs cannot be read within a step", slot, status);
    if (status == OK) note_values(values, count);
    slot->lines = lines; /* the step's own are counted */
}

/* The intermediate update: reads, asks for an early end, now and then breaks rules. */
static void updated(fmi3InstanceEnvironment environment, fmi3Float64 time, fmi3Boolean set_requested,
                    fmi3Boolean get_allowed, fmi3Boolean finished, fmi3Boolean can_return, fmi3Boolean *wanted,
                    fmi3Float64 *end) {
    Slot *slot = environment;
    const char *outer = called;
    if (set_requested || !get_allowed || !finished || can_return != slot->early_allowed)
        fail("the flags of an intermediate update are wrong", slot, OK);
    note_values(&time, 1);
    if (once_in(2)) read_within_step(slot);
    *wanted = once_in(8);
    if (once_in(4)) *end = once_in(9) ? no_number() : time + uniform(-1.0, 2.0);
    for (unsigned k = once_in(100) ? 1 + below(3) : 0; k > 0; k--) {
        const unsigned lines = slot->lines;
        const int status = forbidden(slot);
        if (status != ERROR) fail("a call that is forbidden within a step is no error", slot, status);
        if (slot->lines - lines != slot->log_mask >> 1) fail("an error within a step did not log one line", slot, status);
        slot->inner_error = true;
    }
    called = outer;
}

/* Returns whether the arguments drawn beside name and token are right. */
static bool instantiate(Slot *slot, const char *name, const char *token, bool log_on) {
    const fmi3LogMessageCallback log = slot->has_log ? log_message : NULL;
    if (slot->exchange) {
        called = "fmi3InstantiateModelExchange";
        slot->component = fmi3InstantiateModelExchange(name, token, NULL, false, log_on, slot, log);
        return true;
    }
    const unsigned required[2] = {REFERENCE_OUTPUTS, once_in(20) ? any_reference() : attitude_reference};
    const size_t count = below(3);
    const bool output = count < 2 || (required[1] < VARIABLE_COUNT && VARIABLES[required[1]].role == ROLE_OUTPUT);
    const bool event_mode = once_in(HAS_EVENT_MODE ? 2 : 40), null = once_in(40);
    slot->events = event_mode;
    slot->early_allowed = once_in(2);
    slot->listens = once_in(2);
    called = "fmi3InstantiateCoSimulation";
    slot->component = fmi3InstantiateCoSimulation(name, token, NULL, false, log_on, event_mode, slot->early_allowed,
                                                  null ? NULL : required, count, slot, log,
                                                  slot->listens ? updated : NULL);
    return (!event_mode || HAS_EVENT_MODE) && output && (!null || count == 0);
}
#else
static bool instantiate(Slot *slot, const char *name, const char *token, bool log_on) {
    static fmi2CallbackFunctions callbacks[SLOTS]; /* must live as long as their instances */
    fmi2CallbackFunctions *own = &callbacks[slot - slots];
    const fmi2CallbackFunctions filled = {log_message, NULL, NULL, NULL, slot};
    const int type = once_in(40) ? 7 : slot->exchange ? (int)fmi2ModelExchange : (int)fmi2CoSimulation;
    memcpy((void *)own, &filled, sizeof filled);
    called = "fmi2Instantiate";
    slot->component = fmi2Instantiate(name, (fmi2Type)type, token, NULL, slot->has_log ? own : NULL, false, log_on);
    return type != 7;
}
#endif

static void make_instance(Slot *slot) {
    const char *name = !once_in(20) ? "it" : once_in(2) ? NULL : " \t";
    const char *token = !once_in(20) ? MODEL_TOKEN : once_in(2) ? NULL : "{0}";
    const bool log_on = !once_in(4);
    memset(slot, 0, sizeof *slot);
    slot->exchange = once_in(2);
    slot->has_log = !once_in(8);
    const bool good = instantiate(slot, name, token, log_on) && name && name[0] == 'i' && token == MODEL_TOKEN;
    if (good != (slot->component != NULL)) fail("an instance is made if and only if all arguments are right", slot, OK);
    if (slot->lines != (!good && slot->has_log)) fail("only a refused instantiation logs one line", slot, OK);
    slot->log_mask = slot->has_log && log_on ? 3 : 0;
    slot->now.state = INSTANTIATED;
}

static void free_slot(Slot *slot) {
    if (!slot->component) return;
    for (size_t i = 0; i < SAVED; i++) free_state(slot, &slot->saved[i]);
    free_state(slot, &slot->before);
    EITHER(fmi2FreeInstance, fmi3FreeInstance)(slot->component);
    slot->component = NULL;
}

static Answer enter(Slot *slot) {
    const double start = once_in(30) ? no_number() : once_in(4) ? uniform(-1e5, 1e5) : 0.0;
    const bool stops = once_in(8);
    const double stop = once_in(8) ? no_number() : start + uniform(-1.0, 1e3);
    const bool given = once_in(2);
    const double tolerance = once_in(20) ? odd_number() : pow(10.0, uniform(-15.0, -1.0));
    const bool used = given && ERROR_CONTROLLED && !slot->exchange;
    const bool right =
        isfinite(start) && (!stops || stop >= start) && (!used || (isfinite(tolerance) && tolerance >= 0.0));
    Answer answer = {OK, expect(slot, INSTANTIATED, right)};
#if FMI == 3
    called = "fmi3EnterInitializationMode";
    answer.status = (int)fmi3EnterInitializationMode(slot->component, given, tolerance, start, stops, stop);
    if (answer.status == OK) slot->now = (Known){INITIALIZATION, start, stops};
#else
    if (once_in(2)) {
        called = "fmi2SetupExperiment";
        answer.status = (int)fmi2SetupExperiment(slot->component, given, tolerance, start, stops, stop);
        if (answer.status == OK) slot->now = (Known){INSTANTIATED, start, stops};
        return answer;
    }
    called = "fmi2EnterInitializationMode";
    answer.expected = expect(slot, INSTANTIATED, true);
    answer.status = (int)fmi2EnterInitializationMode(slot->component);
    if (answer.status == OK) slot->now.state = INITIALIZATION;
#endif
    return answer;
}

static Answer leave(Slot *slot) {
    called = EITHER("fmi2ExitInitializationMode", "fmi3ExitInitializationMode");
    Answer answer = {OK, expect(slot, INITIALIZATION, true)};
    answer.status = (int)EITHER(fmi2ExitInitializationMode, fmi3ExitInitializationMode)(slot->component);
    if (answer.status == OK) slot->now.state = slot->exchange || slot->events ? EVENT : STEPPING;
    return answer;
}

static Answer terminate(Slot *slot) {
    if (!once_in(8)) return NOTHING;
    called = EITHER("fmi2Terminate", "fmi3Terminate");
    Answer answer = {OK, expect(slot, RUNNING, true)};
    answer.status = (int)EITHER(fmi2Terminate, fmi3Terminate)(slot->component);
    if (answer.status == OK) slot->now.state = TERMINATED;
    return answer;
}

static Answer start_again(Slot *slot) {
    if (slot->now.state != TERMINATED && !once_in(20)) return NOTHING;
    const Answer answer = {reset(slot), FINE};
    slot->now = (Known){INSTANTIATED, 0.0, false};
    return answer;
}

static Answer set_logging(Slot *slot) {
    static const char *const names[] = {"logStatusDiscard", "logStatusError", "logComposite", "logAll", "log", NULL};
    static const unsigned masks[] = {1, 2, 0, 3, 0, 0};
    const bool on = !once_in(4), null = once_in(20);
    const size_t count = below(4);
    const char *chosen[4] = {NULL, NULL, NULL, NULL};
    unsigned mask = count == 0 ? 3 : 0;
    bool right = count == 0 || !null;
    for (size_t i = 0; i < count; i++) {
        const unsigned k = once_in(20) ? 4 + below(2) : below(4);
        chosen[i] = names[k];
        mask |= masks[k];
        right = right && k < 4;
    }
    called = EITHER("fmi2SetDebugLogging", "fmi3SetDebugLogging");
    Answer answer = {OK, right ? FINE : AN_ERROR};
    answer.status = (int)EITHER(fmi2SetDebugLogging, fmi3SetDebugLogging)(slot->component, on, count,
                                                                          null ? NULL : chosen);
    if (answer.status == OK && slot->has_log) slot->log_mask = on ? slot->log_mask | mask : slot->log_mask & ~mask;
    return answer;
}

static Answer destroy(Slot *slot) {
    if (once_in(200)) free_slot(slot);
    return NOTHING;
}

#endif
