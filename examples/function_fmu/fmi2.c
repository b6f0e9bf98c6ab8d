/* FMI 2.0 for co-simulation, with fmu_build/c/fmi2_unsupported.c. */
#include "fmi2Functions.h"

#include <stdlib.h>

#include "instance.h"

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

static const Call SET_DEBUG_LOGGING = {"fmi2SetDebugLogging", ANY_STATE, STATUS_ERROR};
static const Call SETUP_EXPERIMENT = {"fmi2SetupExperiment", INSTANTIATED, STATUS_ERROR};
static const Call ENTER_INITIALIZATION = {"fmi2EnterInitializationMode", INSTANTIATED, STATUS_ERROR};
static const Call EXIT_INITIALIZATION = {"fmi2ExitInitializationMode", INITIALIZATION, STATUS_ERROR};
static const Call TERMINATE = {"fmi2Terminate", STEPPING, STATUS_ERROR};
static const Call RESET = {"fmi2Reset", ANY_STATE, STATUS_ERROR};
static const Call GET_REAL = {"fmi2GetReal", INITIALIZATION | STEPPING | TERMINATED, STATUS_ERROR};
static const Call SET_REAL = {"fmi2SetReal", INSTANTIATED | INITIALIZATION | STEPPING, STATUS_DISCARD};
static const Call DO_STEP = {"fmi2DoStep", STEPPING, STATUS_DISCARD};

/* No message holds a %. */
static void write_log(const Instance *instance, Status status, const char *category, const char *message) {
    const fmi2CallbackLogger logger = (fmi2CallbackLogger)instance->log_callback;
    if (logger) logger(instance->environment, instance->name, (fmi2Status)status, category, message);
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token, fmi2String resource_location,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging_on) {
    Instance *instance = type == fmi2CoSimulation ? instance_new(name, token) : NULL;
    if (!instance) {
        if (functions && functions->logger)
            functions->logger(functions->componentEnvironment, name ? name : "", fmi2Error, "logStatusError",
                              "fmi2Instantiate: fmuGUID is not that of this library, or no co-simulation is asked for");
        return NULL;
    }
    instance->environment = functions ? functions->componentEnvironment : NULL;
    instance->log_callback = functions ? (void (*)(void))functions->logger : NULL;
    instance->write_log = write_log;
    instance->logging = logging_on;
    return instance;
}

void fmi2FreeInstance(fmi2Component instance) {
    free(instance);
}

const char *fmi2GetTypesPlatform(void) {
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void) {
    return fmi2Version;
}

/* Goes on to another state. */
static fmi2Status enter(Instance *instance, const Call *call, State next) {
    if (!instance || !instance_admits(instance, call)) return fmi2Error;
    instance->state = next;
    return fmi2OK;
}

fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean on, size_t count, const fmi2String categories[]) {
    Instance *instance = component;
    if (!instance || !instance_admits(instance, &SET_DEBUG_LOGGING)) return fmi2Error;
    instance->logging = on;
    return fmi2OK;
}

fmi2Status fmi2SetupExperiment(fmi2Component instance, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                               fmi2Real start_time, fmi2Boolean stop_time_defined, fmi2Real stop_time) {
    if (!instance || !instance_admits(instance, &SETUP_EXPERIMENT)) return fmi2Error;
    return (fmi2Status)instance_start(instance, start_time);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component instance) {
    return enter(instance, &ENTER_INITIALIZATION, INITIALIZATION);
}

fmi2Status fmi2ExitInitializationMode(fmi2Component instance) {
    return enter(instance, &EXIT_INITIALIZATION, STEPPING);
}

fmi2Status fmi2Terminate(fmi2Component instance) {
    return enter(instance, &TERMINATE, TERMINATED);
}

fmi2Status fmi2Reset(fmi2Component instance) {
    if (!instance || !instance_admits(instance, &RESET)) return fmi2Error;
    instance_reset(instance);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component instance, const fmi2ValueReference references[], size_t count, fmi2Real values[]) {
    if (!instance || !instance_admits(instance, &GET_REAL)) return fmi2Error;
    return (fmi2Status)instance_get(instance, references, count, values);
}

fmi2Status fmi2SetReal(fmi2Component instance, const fmi2ValueReference references[], size_t count,
                       const fmi2Real values[]) {
    if (!instance || !instance_admits(instance, &SET_REAL)) return fmi2Error;
    return (fmi2Status)instance_set(instance, references, count, values);
}

fmi2Status fmi2DoStep(fmi2Component instance, fmi2Real time, fmi2Real h, fmi2Boolean no_state_before) {
    if (!instance || !instance_admits(instance, &DO_STEP)) return fmi2Error;
    return (fmi2Status)instance_step(instance, time, h);
}

#define UNSUPPORTED(X)                                                                                            \
    X(GetFMUstate, (fmi2Component instance, fmi2FMUstate * state))                                                \
    X(SetFMUstate, (fmi2Component instance, fmi2FMUstate state))                                                  \
    X(FreeFMUstate, (fmi2Component instance, fmi2FMUstate * state))                                               \
    X(SerializedFMUstateSize, (fmi2Component instance, fmi2FMUstate state, size_t * size))                        \
    X(SerializeFMUstate, (fmi2Component instance, fmi2FMUstate state, fmi2Byte bytes[], size_t size))             \
    X(DeSerializeFMUstate, (fmi2Component instance, const fmi2Byte bytes[], size_t size, fmi2FMUstate * state))   \
    X(GetDirectionalDerivative,                                                                                   \
      (fmi2Component instance, const fmi2ValueReference unknowns[], size_t unknown_count,                         \
       const fmi2ValueReference knowns[], size_t known_count, const fmi2Real seed[], fmi2Real sensitivity[]))     \
    X(GetRealOutputDerivatives, (fmi2Component instance, const fmi2ValueReference references[], size_t count,     \
                                 const fmi2Integer orders[], fmi2Real values[]))                                  \
    X(GetStatus, (fmi2Component instance, const fmi2StatusKind kind, fmi2Status * value))                         \
    X(GetRealStatus, (fmi2Component instance, const fmi2StatusKind kind, fmi2Real * value))                       \
    X(GetIntegerStatus, (fmi2Component instance, const fmi2StatusKind kind, fmi2Integer * value))                 \
    X(GetBooleanStatus, (fmi2Component instance, const fmi2StatusKind kind, fmi2Boolean * value))                 \
    X(GetStringStatus, (fmi2Component instance, const fmi2StatusKind kind, fmi2String * value))

#define DEFINE_UNSUPPORTED(NAME, PARAMETERS)                                            \
    fmi2Status fmi2##NAME PARAMETERS {                                                  \
        static const Call call = {"fmi2" #NAME, ANY_STATE, STATUS_ERROR};               \
        if (!instance || !instance_admits(instance, &call)) return fmi2Error;           \
        return (fmi2Status)instance_error(instance, "belongs to a capability that this FMU does not have");    \
    }

UNSUPPORTED(DEFINE_UNSUPPORTED)
