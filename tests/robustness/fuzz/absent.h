/* Functions of what the FMU does not have, all in this version's header that are not called elsewhere; calls without
   an instance. */
#ifndef FUZZ_ABSENT_H
#define FUZZ_ABSENT_H

#include "functions.h"

#if DOCK_COUNT
#define BOOLEAN(X)
#else
#define BOOLEAN(X) X(Boolean)
#endif

#if FMI == 3
#define OTHER_TYPES(X) \
    X(Float32) X(Int8) X(UInt8) X(Int16) X(UInt16) X(Int32) X(UInt32) X(Int64) X(UInt64) BOOLEAN(X) X(String)
#define PREFIXED(NAME) fmi3##NAME
#define TEXT(NAME) "fmi3" #NAME
#define SIZES_OF(count) , count
#else
#define OTHER_TYPES(X) X(Integer) BOOLEAN(X) X(String)
#define PREFIXED(NAME) fmi2##NAME
#define TEXT(NAME) "fmi2" #NAME
#define SIZES_OF(count)
#endif

static Answer other_type(Slot *slot) {
    unsigned choice = below(22);
    const unsigned reference = any_reference();
    const size_t count = once_in(8);
    Answer answer = {OK, count == 0 ? FINE : AN_ERROR};
#define ACCESS(TYPE)                                                                                           \
    if (choice-- == 0) {                                                                                       \
        called = TEXT(Get##TYPE);                                                                              \
        answer.status = (int)PREFIXED(Get##TYPE)(slot->component, &reference, count, NULL SIZES_OF(count));    \
        return answer;                                                                                         \
    }                                                                                                          \
    if (choice-- == 0) {                                                                                       \
        called = TEXT(Set##TYPE);                                                                              \
        answer.status = (int)PREFIXED(Set##TYPE)(slot->component, &reference, count, NULL SIZES_OF(count));    \
        return answer;                                                                                         \
    }
    OTHER_TYPES(ACCESS)
#undef ACCESS
    return NOTHING;
}

static Answer unsupported(Slot *slot) {
    Answer answer = {OK, AN_ERROR};
    void *component = slot->component;
    if (!once_in(20)) return NOTHING;
#define CALL(NAME, ARGUMENTS)                              \
    if (once_in(6)) {                                      \
        called = TEXT(NAME);                               \
        answer.status = (int)PREFIXED(NAME) ARGUMENTS;     \
        return answer;                                     \
    }
#if FMI == 3
    CALL(GetNumberOfVariableDependencies, (component, 0, NULL))
    CALL(GetVariableDependencies, (component, 0, NULL, NULL, NULL, NULL, 0))
    CALL(EnterConfigurationMode, (component))
    CALL(ExitConfigurationMode, (component))
    CALL(GetIntervalDecimal, (component, NULL, 1, NULL, NULL))
    CALL(GetIntervalFraction, (component, NULL, 1, NULL, NULL, NULL))
    CALL(GetShiftDecimal, (component, NULL, 1, NULL))
    CALL(GetShiftFraction, (component, NULL, 1, NULL, NULL))
    CALL(SetIntervalDecimal, (component, NULL, 1, NULL))
    CALL(SetIntervalFraction, (component, NULL, 1, NULL, NULL))
    CALL(SetShiftDecimal, (component, NULL, 1, NULL))
    CALL(SetShiftFraction, (component, NULL, 1, NULL, NULL))
    CALL(EvaluateDiscreteStates, (component))
#if !DOCK_COUNT
    CALL(EnterStepMode, (component))
#endif
    CALL(ActivateModelPartition, (component, 0, 0.0))
    CALL(GetBinary, (component, NULL, 1, NULL, NULL, 1))
    CALL(SetBinary, (component, NULL, 1, NULL, NULL, 1))
    CALL(GetClock, (component, NULL, 1, NULL))
    CALL(SetClock, (component, NULL, 1, NULL))
#else
    CALL(SetRealInputDerivatives, (component, NULL, 1, NULL, NULL))
    CALL(CancelStep, (component))
#endif
#undef CALL
    return NOTHING;
}

/* No instance: an error, and nothing to log to. */
static Answer without_instance(Slot *slot) {
    Slot nobody = *slot;
    void *state = NULL;
    nobody.component = NULL;
    int status = ERROR;
    switch (below(5)) {
        case 0: status = get_values(&nobody, NULL, 1, NULL, 1); break;
        case 1: status = set_values(&nobody, NULL, 1, NULL, 1); break;
        case 2: status = save(&nobody, &state); break;
        case 3: status = restore(&nobody, slot->before); break;
        default: status = reset(&nobody);
    }
    if (status != ERROR || slot->lines != 0) fail("a call without an instance is no error", slot, status);
    return NOTHING;
}

#endif
