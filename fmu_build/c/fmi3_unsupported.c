/* The functions of FMI 3.0 that belong to capabilities which this FMU does not claim. Importers look all of
   them up, so they exist; each logs one line and returns an error. */
#include "fmi3Functions.h"

#include "instance.h"

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

static fmi3Status unsupported(Instance *instance, const Call *call) {
    if (!instance || !instance_admits(instance, call)) return fmi3Error;
    return (fmi3Status)instance_error(instance, "belongs to a capability that this FMU does not have");
}

#if DOCK_COUNT
#define BOOLEAN(X)
#define STEP_MODE(X)
#define TYPES "all variables are Float64 or Boolean"
#else
#define BOOLEAN(X) X(Boolean)
#define STEP_MODE(X) X(EnterStepMode, (fmi3Instance instance))
#define TYPES "all variables are Float64"
#endif

/* Any reference given to another type's function is wrong. */
static fmi3Status other_type(Instance *instance, const Call *call, size_t count) {
    if (!instance || !instance_admits(instance, call)) return fmi3Error;
    if (count == 0) return fmi3OK;
    return (fmi3Status)instance_error(instance, TYPES ", none has this type");
}

#define OTHER_TYPES(X) \
    X(Float32) X(Int8) X(UInt8) X(Int16) X(UInt16) X(Int32) X(UInt32) X(Int64) X(UInt64) BOOLEAN(X) X(String)

#define DEFINE_ACCESSORS(TYPE)                                                                           \
    fmi3Status fmi3Get##TYPE(fmi3Instance instance, const fmi3ValueReference references[], size_t count, \
                             fmi3##TYPE values[], size_t value_count) {                                  \
        static const Call call = {"fmi3Get" #TYPE, ANY_STATE, STATUS_ERROR};                             \
        return other_type(instance, &call, count);                                                       \
    }                                                                                                    \
    fmi3Status fmi3Set##TYPE(fmi3Instance instance, const fmi3ValueReference references[], size_t count, \
                             const fmi3##TYPE values[], size_t value_count) {                            \
        static const Call call = {"fmi3Set" #TYPE, ANY_STATE, STATUS_ERROR};                             \
        return other_type(instance, &call, count);                                                       \
    }

OTHER_TYPES(DEFINE_ACCESSORS)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference references[], size_t count, size_t sizes[],
                         fmi3Binary values[], size_t value_count) {
    static const Call call = {"fmi3GetBinary", ANY_STATE, STATUS_ERROR};
    return other_type(instance, &call, count);
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                         const size_t sizes[], const fmi3Binary values[], size_t value_count) {
    static const Call call = {"fmi3SetBinary", ANY_STATE, STATUS_ERROR};
    return other_type(instance, &call, count);
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                        fmi3Clock values[]) {
    static const Call call = {"fmi3GetClock", ANY_STATE, STATUS_ERROR};
    return other_type(instance, &call, count);
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                        const fmi3Clock values[]) {
    static const Call call = {"fmi3SetClock", ANY_STATE, STATUS_ERROR};
    return other_type(instance, &call, count);
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resource_path,
                                               fmi3Boolean visible, fmi3Boolean logging_on,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log_message,
                                               fmi3ClockUpdateCallback clock_update,
                                               fmi3LockPreemptionCallback lock_preemption,
                                               fmi3UnlockPreemptionCallback unlock_preemption) {
    if (log_message)
        log_message(environment, fmi3Error, "logStatusError",
                    "fmi3InstantiateScheduledExecution: this FMU has no scheduled execution");
    return NULL;
}

#define UNSUPPORTED(X)                                                                                             \
    X(GetNumberOfVariableDependencies,                                                                             \
      (fmi3Instance instance, fmi3ValueReference reference, size_t * dependency_count))                            \
    X(GetVariableDependencies,                                                                                     \
      (fmi3Instance instance, fmi3ValueReference dependent, size_t dependent_elements[],                           \
       fmi3ValueReference independents[], size_t independent_elements[], fmi3DependencyKind kinds[],               \
       size_t dependency_count))                                                                                   \
    X(EnterConfigurationMode, (fmi3Instance instance))                                                             \
    X(ExitConfigurationMode, (fmi3Instance instance))                                                              \
    X(GetIntervalDecimal, (fmi3Instance instance, const fmi3ValueReference references[], size_t count,             \
                           fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]))                           \
    X(GetIntervalFraction, (fmi3Instance instance, const fmi3ValueReference references[], size_t count,            \
                            fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]))  \
    X(GetShiftDecimal,                                                                                             \
      (fmi3Instance instance, const fmi3ValueReference references[], size_t count, fmi3Float64 shifts[]))          \
    X(GetShiftFraction, (fmi3Instance instance, const fmi3ValueReference references[], size_t count,               \
                         fmi3UInt64 counters[], fmi3UInt64 resolutions[]))                                         \
    X(SetIntervalDecimal,                                                                                          \
      (fmi3Instance instance, const fmi3ValueReference references[], size_t count, const fmi3Float64 intervals[])) \
    X(SetIntervalFraction, (fmi3Instance instance, const fmi3ValueReference references[], size_t count,            \
                            const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]))                          \
    X(SetShiftDecimal,                                                                                             \
      (fmi3Instance instance, const fmi3ValueReference references[], size_t count, const fmi3Float64 shifts[]))    \
    X(SetShiftFraction, (fmi3Instance instance, const fmi3ValueReference references[], size_t count,               \
                         const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]))                             \
    X(EvaluateDiscreteStates, (fmi3Instance instance))                                                             \
    STEP_MODE(X)                                                                                                   \
    X(ActivateModelPartition, (fmi3Instance instance, fmi3ValueReference clock, fmi3Float64 time))

#define DEFINE_UNSUPPORTED(NAME, PARAMETERS)                              \
    fmi3Status fmi3##NAME PARAMETERS {                                    \
        static const Call call = {"fmi3" #NAME, ANY_STATE, STATUS_ERROR}; \
        return unsupported(instance, &call);                              \
    }

UNSUPPORTED(DEFINE_UNSUPPORTED)
