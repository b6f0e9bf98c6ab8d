/* The functions of FMI 2.0 that this FMU supports: co-simulation. The others are in fmi2_unsupported.c. */
#include "fmi2Functions.h"

#include <stddef.h>
#include <string.h>

#include "instance.h"

enum { ANY_STATE = INSTANTIATED | INITIALIZATION | STEPPING | TERMINATED };

static const Call INSTANTIATE = {"fmi2Instantiate", ANY_STATE, STATUS_ERROR};
static const Call SET_DEBUG_LOGGING = {"fmi2SetDebugLogging", ANY_STATE, STATUS_ERROR};
static const Call SETUP_EXPERIMENT = {"fmi2SetupExperiment", INSTANTIATED, STATUS_ERROR};
static const Call ENTER_INITIALIZATION = {"fmi2EnterInitializationMode", INSTANTIATED, STATUS_ERROR};
static const Call EXIT_INITIALIZATION = {"fmi2ExitInitializationMode", INITIALIZATION, STATUS_ERROR};
static const Call TERMINATE = {"fmi2Terminate", STEPPING, STATUS_ERROR};
static const Call GET_REAL = {"fmi2GetReal", INITIALIZATION | STEPPING | TERMINATED, STATUS_ERROR};
static const Call SET_REAL = {"fmi2SetReal", INSTANTIATED | INITIALIZATION | STEPPING, STATUS_DISCARD};
static const Call DO_STEP = {"fmi2DoStep", STEPPING, STATUS_DISCARD};

static void write_log(const Instance *instance, Status status, const char *category, const char *message) {
    const fmi2CallbackLogger logger = (fmi2CallbackLogger)instance->log_callback;
    if (logger) logger(instance->environment, instance->name, (fmi2Status)status, category, message);
}

/* What keeps an instance from being made, or NULL. */
static const char *instantiation_problem(fmi2String name, fmi2Type type, fmi2String token) {
    if (!name || name[strspn(name, " \t\r\n")] == '\0')
        return "fmi2Instantiate: instanceName must hold a character that is no white space";
    if (type != fmi2CoSimulation) return "fmi2Instantiate: this FMU has co-simulation only";
    if (!token || strcmp(token, MODEL_TOKEN) != 0)
        return "fmi2Instantiate: fmuGUID is not that of this library; modelDescription.xml belongs to another build";
    return NULL;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token, fmi2String resource_location,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging_on) {
    (void)resource_location, (void)visible;
    const char *problem = instantiation_problem(name, type, token);
    Instance *instance = problem ? NULL : instance_new(name);
    if (!instance) {
        if (functions && functions->logger)
            functions->logger(functions->componentEnvironment, name ? name : "", fmi2Error, "logStatusError",
                              problem ? problem : "fmi2Instantiate: out of memory");
        return NULL;
    }
    instance->call = &INSTANTIATE;
    instance->environment = functions ? functions->componentEnvironment : NULL;
    instance->log_callback = functions ? (void (*)(void))functions->logger : NULL;
    instance->write_log = write_log;
    instance->log_categories = logging_on ? LOG_ALL : 0;
    return instance;
}

void fmi2FreeInstance(fmi2Component instance) {
    instance_free(instance);
}

const char *fmi2GetTypesPlatform(void) {
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void) {
    return fmi2Version;
}

fmi2Status fmi2SetDebugLogging(fmi2Component instance, fmi2Boolean on, size_t count, const fmi2String categories[]) {
    if (!instance || !instance_admits(instance, &SET_DEBUG_LOGGING)) return fmi2Error;
    return (fmi2Status)instance_set_logging(instance, on != fmi2False, count, categories);
}

fmi2Status fmi2SetupExperiment(fmi2Component instance, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                               fmi2Real start_time, fmi2Boolean stop_time_defined, fmi2Real stop_time) {
    (void)tolerance_defined, (void)tolerance;
    if (!instance || !instance_admits(instance, &SETUP_EXPERIMENT)) return fmi2Error;
    return (fmi2Status)instance_set_times(instance, start_time, stop_time_defined != fmi2False, stop_time);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component instance) {
    if (!instance || !instance_admits(instance, &ENTER_INITIALIZATION)) return fmi2Error;
    ((Instance *)instance)->state = INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component instance) {
    if (!instance || !instance_admits(instance, &EXIT_INITIALIZATION)) return fmi2Error;
    return (fmi2Status)instance_exit_initialization(instance);
}

fmi2Status fmi2Terminate(fmi2Component instance) {
    if (!instance || !instance_admits(instance, &TERMINATE)) return fmi2Error;
    ((Instance *)instance)->state = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component instance) {
    if (!instance) return fmi2Error;
    instance_reset(instance);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component instance, const fmi2ValueReference references[], size_t count,
                       fmi2Real values[]) {
    if (!instance || !instance_admits(instance, &GET_REAL)) return fmi2Error;
    return (fmi2Status)instance_get(instance, references, count, values);
}

fmi2Status fmi2SetReal(fmi2Component instance, const fmi2ValueReference references[], size_t count,
                       const fmi2Real values[]) {
    if (!instance || !instance_admits(instance, &SET_REAL)) return fmi2Error;
    return (fmi2Status)instance_set(instance, references, count, values);
}

fmi2Status fmi2DoStep(fmi2Component instance, fmi2Real time, fmi2Real step_size,
                      fmi2Boolean no_set_state_before_now) {
    (void)no_set_state_before_now;
    if (!instance || !instance_admits(instance, &DO_STEP)) return fmi2Error;
    return (fmi2Status)solver_step(instance, time, step_size);
}

/* Answers a question about the last step that this FMU, whose steps are synchronous, has no answer to. */
static fmi2Status no_status(Instance *instance, const Call *call, fmi2StatusKind kind) {
    if (!instance || !instance_admits(instance, call)) return fmi2Error;
    return (fmi2Status)instance_refuse(instance, "there is no status of kind %d", (int)kind);
}

fmi2Status fmi2GetRealStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Real *value) {
    static const Call call = {"fmi2GetRealStatus", STEPPING | TERMINATED, STATUS_DISCARD};
    if (kind != fmi2LastSuccessfulTime) return no_status(instance, &call, kind);
    if (!instance || !instance_admits(instance, &call)) return fmi2Error;
    if (!value) return (fmi2Status)instance_error(instance, "value is NULL");
    *value = ((Instance *)instance)->time;
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Boolean *value) {
    static const Call call = {"fmi2GetBooleanStatus", STEPPING | TERMINATED, STATUS_DISCARD};
    if (kind != fmi2Terminated) return no_status(instance, &call, kind);
    if (!instance || !instance_admits(instance, &call)) return fmi2Error;
    if (!value) return (fmi2Status)instance_error(instance, "value is NULL");
    *value = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Status *value) {
    static const Call call = {"fmi2GetStatus", STEPPING | TERMINATED, STATUS_DISCARD};
    (void)value;
    return no_status(instance, &call, kind);
}

fmi2Status fmi2GetIntegerStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Integer *value) {
    static const Call call = {"fmi2GetIntegerStatus", STEPPING | TERMINATED, STATUS_DISCARD};
    (void)value;
    return no_status(instance, &call, kind);
}

fmi2Status fmi2GetStringStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2String *value) {
    static const Call call = {"fmi2GetStringStatus", STEPPING | TERMINATED, STATUS_DISCARD};
    (void)value;
    return no_status(instance, &call, kind);
}
