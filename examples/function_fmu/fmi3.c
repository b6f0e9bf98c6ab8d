/* FMI 3.0 for co-simulation, with fmu_build/c/fmi3_unsupported.c. */
#include "fmi3Functions.h"

#include <stdlib.h>

#include "instance.h"

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

static const Call SET_DEBUG_LOGGING = {"fmi3SetDebugLogging", ANY_STATE, STATUS_ERROR};
static const Call ENTER_INITIALIZATION = {"fmi3EnterInitializationMode", INSTANTIATED, STATUS_ERROR};
static const Call EXIT_INITIALIZATION = {"fmi3ExitInitializationMode", INITIALIZATION, STATUS_ERROR};
static const Call TERMINATE = {"fmi3Terminate", STEPPING, STATUS_ERROR};
static const Call RESET = {"fmi3Reset", ANY_STATE, STATUS_ERROR};
static const Call GET_FLOAT64 = {"fmi3GetFloat64", ANY_STATE, STATUS_DISCARD};
static const Call SET_FLOAT64 = {"fmi3SetFloat64", INSTANTIATED | INITIALIZATION | STEPPING, STATUS_DISCARD};
static const Call DO_STEP = {"fmi3DoStep", STEPPING, STATUS_DISCARD};

static void write_log(const Instance *instance, Status status, const char *category, const char *message) {
    const fmi3LogMessageCallback log_message = (fmi3LogMessageCallback)instance->log_callback;
    if (log_message) log_message(instance->environment, (fmi3Status)status, category, message);
}

/* Logs why there is no instance. */
static fmi3Instance refused(fmi3InstanceEnvironment environment, fmi3LogMessageCallback log_message,
                            const char *problem) {
    if (log_message) log_message(environment, fmi3Error, "logStatusError", problem);
    return NULL;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resource_path,
                                         fmi3Boolean visible, fmi3Boolean logging_on, fmi3Boolean event_mode_used,
                                         fmi3Boolean early_return_allowed,
                                         const fmi3ValueReference intermediate_variables[], size_t intermediate_count,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log_message,
                                         fmi3IntermediateUpdateCallback intermediate_update) {
    Instance *instance = event_mode_used ? NULL : instance_new(name, token);
    if (!instance)
        return refused(environment, log_message,
                       "fmi3InstantiateCoSimulation: instantiationToken is not that of this library, or event mode is "
                       "asked for");
    instance->environment = environment;
    instance->log_callback = (void (*)(void))log_message;
    instance->write_log = write_log;
    instance->logging = logging_on;
    return instance;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resource_path,
                                          fmi3Boolean visible, fmi3Boolean logging_on,
                                          fmi3InstanceEnvironment environment, fmi3LogMessageCallback log_message) {
    return refused(environment, log_message, "fmi3InstantiateModelExchange: this FMU is for co-simulation alone");
}

void fmi3FreeInstance(fmi3Instance instance) {
    free(instance);
}

const char *fmi3GetVersion(void) {
    return fmi3Version;
}

/* Goes on to another state. */
static fmi3Status enter(Instance *instance, const Call *call, State next) {
    if (!instance || !instance_admits(instance, call)) return fmi3Error;
    instance->state = next;
    return fmi3OK;
}

fmi3Status fmi3SetDebugLogging(fmi3Instance handle, fmi3Boolean on, size_t count, const fmi3String categories[]) {
    Instance *instance = handle;
    if (!instance || !instance_admits(instance, &SET_DEBUG_LOGGING)) return fmi3Error;
    instance->logging = on;
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start_time, fmi3Boolean stop_time_defined, fmi3Float64 stop_time) {
    const fmi3Status status = enter(instance, &ENTER_INITIALIZATION, INITIALIZATION);
    return status == fmi3OK ? (fmi3Status)instance_start(instance, start_time) : status;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    return enter(instance, &EXIT_INITIALIZATION, STEPPING);
}

fmi3Status fmi3Terminate(fmi3Instance instance) {
    return enter(instance, &TERMINATE, TERMINATED);
}

fmi3Status fmi3Reset(fmi3Instance instance) {
    if (!instance || !instance_admits(instance, &RESET)) return fmi3Error;
    instance_reset(instance);
    return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                          fmi3Float64 values[], size_t value_count) {
    if (!instance || !instance_admits(instance, &GET_FLOAT64)) return fmi3Error;
    if (value_count != count) return (fmi3Status)instance_error(instance, "nValues must be nValueReferences");
    return (fmi3Status)instance_get(instance, references, count, values);
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                          const fmi3Float64 values[], size_t value_count) {
    if (!instance || !instance_admits(instance, &SET_FLOAT64)) return fmi3Error;
    if (value_count != count) return (fmi3Status)instance_error(instance, "nValues must be nValueReferences");
    return (fmi3Status)instance_set(instance, references, count, values);
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 time, fmi3Float64 h, fmi3Boolean no_state_before,
                      fmi3Boolean *event_needed, fmi3Boolean *terminate, fmi3Boolean *early_return,
                      fmi3Float64 *last_time) {
    if (!instance || !instance_admits(instance, &DO_STEP)) return fmi3Error;
    if (!event_needed || !terminate || !early_return || !last_time)
        return (fmi3Status)instance_error(instance, "an argument for a result is NULL");
    const Status status = instance_step(instance, time, h);
    *event_needed = *terminate = *early_return = fmi3False;
    *last_time = status == STATUS_OK ? time + h : time;
    return (fmi3Status)status;
}

#define UNSUPPORTED(X)                                                                                              \
    X(GetFMUState, (fmi3Instance instance, fmi3FMUState * state))                                                   \
    X(SetFMUState, (fmi3Instance instance, fmi3FMUState state))                                                     \
    X(FreeFMUState, (fmi3Instance instance, fmi3FMUState * state))                                                  \
    X(SerializedFMUStateSize, (fmi3Instance instance, fmi3FMUState state, size_t * size))                           \
    X(SerializeFMUState, (fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size))                \
    X(DeserializeFMUState, (fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState * state))      \
    X(GetDirectionalDerivative,                                                                                     \
      (fmi3Instance instance, const fmi3ValueReference unknowns[], size_t unknown_count,                            \
       const fmi3ValueReference knowns[], size_t known_count, const fmi3Float64 seed[], size_t seed_count,          \
       fmi3Float64 sensitivity[], size_t sensitivity_count))                                                        \
    X(GetAdjointDerivative,                                                                                         \
      (fmi3Instance instance, const fmi3ValueReference unknowns[], size_t unknown_count,                            \
       const fmi3ValueReference knowns[], size_t known_count, const fmi3Float64 seed[], size_t seed_count,          \
       fmi3Float64 sensitivity[], size_t sensitivity_count))                                                        \
    X(GetOutputDerivatives, (fmi3Instance instance, const fmi3ValueReference references[], size_t count,            \
                             const fmi3Int32 orders[], fmi3Float64 values[], size_t value_count))                   \
    X(EnterEventMode, (fmi3Instance instance))                                                                      \
    X(UpdateDiscreteStates,                                                                                         \
      (fmi3Instance instance, fmi3Boolean * again, fmi3Boolean * terminate, fmi3Boolean * nominals_changed,         \
       fmi3Boolean * states_changed, fmi3Boolean * next_event_defined, fmi3Float64 * next_event))                   \
    X(EnterContinuousTimeMode, (fmi3Instance instance))                                                             \
    X(CompletedIntegratorStep,                                                                                      \
      (fmi3Instance instance, fmi3Boolean no_state_before, fmi3Boolean * enter_event, fmi3Boolean * terminate))     \
    X(SetTime, (fmi3Instance instance, fmi3Float64 time))                                                           \
    X(SetContinuousStates, (fmi3Instance instance, const fmi3Float64 states[], size_t count))                       \
    X(GetContinuousStates, (fmi3Instance instance, fmi3Float64 states[], size_t count))                             \
    X(GetContinuousStateDerivatives, (fmi3Instance instance, fmi3Float64 rates[], size_t count))                    \
    X(GetNominalsOfContinuousStates, (fmi3Instance instance, fmi3Float64 nominals[], size_t count))                 \
    X(GetEventIndicators, (fmi3Instance instance, fmi3Float64 indicators[], size_t count))                          \
    X(GetNumberOfEventIndicators, (fmi3Instance instance, size_t * count))                                          \
    X(GetNumberOfContinuousStates, (fmi3Instance instance, size_t * count))

#define DEFINE_UNSUPPORTED(NAME, PARAMETERS)                                            \
    fmi3Status fmi3##NAME PARAMETERS {                                                  \
        static const Call call = {"fmi3" #NAME, ANY_STATE, STATUS_ERROR};               \
        if (!instance || !instance_admits(instance, &call)) return fmi3Error;           \
        return (fmi3Status)instance_error(instance, "belongs to a capability that this FMU does not have");    \
    }

UNSUPPORTED(DEFINE_UNSUPPORTED)
