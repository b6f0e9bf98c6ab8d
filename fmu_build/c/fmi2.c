/* The functions of FMI 2.0 that this FMU supports: co-simulation and model exchange. The others are in
   fmi2_unsupported.c. */
#include "fmi2Functions.h"

#include <stddef.h>
#include <string.h>

#include "booleans.h"
#include "changes.h"
#include "derivatives.h"
#include "saved_state.h"
#include "solver.h"

enum {
    STARTED = INITIALIZATION | RUNNING | TERMINATED,
    EXCHANGING = EVENT | CONTINUOUS,
    OUTSIDE_STEPS = ONLY_MODEL_EXCHANGE | (ANY_STATE & ~STEPPING & ~INTERMEDIATE),
    STEPPED = ONLY_CO_SIMULATION | STEPPING | TERMINATED,
    INTEGRATED = ONLY_MODEL_EXCHANGE | INITIALIZATION | EXCHANGING | TERMINATED
};

static const Call INSTANTIATE = {"fmi2Instantiate", ANY_STATE, STATUS_ERROR};
static const Call SET_DEBUG_LOGGING = {"fmi2SetDebugLogging", ANY_STATE, STATUS_ERROR};
static const Call SETUP_EXPERIMENT = {"fmi2SetupExperiment", INSTANTIATED, STATUS_ERROR};
static const Call ENTER_INITIALIZATION = {"fmi2EnterInitializationMode", INSTANTIATED, STATUS_ERROR};
static const Call EXIT_INITIALIZATION = {"fmi2ExitInitializationMode", INITIALIZATION, STATUS_ERROR};
static const Call TERMINATE = {"fmi2Terminate", RUNNING, STATUS_ERROR};
static const Call RESET = {"fmi2Reset", ANY_STATE, STATUS_ERROR};
static const Call GET_REAL_CS = {"fmi2GetReal", STARTED, STATUS_ERROR};
static const Call GET_REAL_ME = {"fmi2GetReal", STARTED, STATUS_DISCARD};
static const Call SET_REAL = {"fmi2SetReal", BEFORE_START | RUNNING, STATUS_DISCARD};
static const Call DO_STEP = {"fmi2DoStep", STEPPING, STATUS_ERROR};
static const Call GET_OUTPUT_DERIVATIVES = {"fmi2GetRealOutputDerivatives", STEPPED, STATUS_ERROR};
static const Call GET_DIRECTIONAL = {"fmi2GetDirectionalDerivative", STARTED, STATUS_ERROR};
static const Call GET_STATE = {"fmi2GetFMUstate", ANY_STATE, STATUS_ERROR};
static const Call SET_STATE = {"fmi2SetFMUstate", ANY_STATE, STATUS_ERROR};
static const Call FREE_STATE = {"fmi2FreeFMUstate", ANY_STATE, STATUS_ERROR};
static const Call STATE_SIZE = {"fmi2SerializedFMUstateSize", ANY_STATE, STATUS_ERROR};
static const Call SERIALIZE = {"fmi2SerializeFMUstate", ANY_STATE, STATUS_ERROR};
static const Call DESERIALIZE = {"fmi2DeSerializeFMUstate", ANY_STATE, STATUS_ERROR};
static const Call ENTER_EVENT = {"fmi2EnterEventMode", EXCHANGING, STATUS_ERROR};
static const Call NEW_DISCRETE = {"fmi2NewDiscreteStates", EVENT, STATUS_ERROR};
static const Call ENTER_CONTINUOUS = {"fmi2EnterContinuousTimeMode", EVENT, STATUS_ERROR};
static const Call COMPLETED_STEP = {"fmi2CompletedIntegratorStep", CONTINUOUS, STATUS_ERROR};
static const Call SET_TIME = {"fmi2SetTime", EXCHANGING, STATUS_ERROR};
static const Call SET_STATES = {"fmi2SetContinuousStates", CONTINUOUS, STATUS_DISCARD};
static const Call GET_STATES = {"fmi2GetContinuousStates", INTEGRATED, STATUS_DISCARD};
static const Call GET_RATES = {"fmi2GetDerivatives", INTEGRATED, STATUS_DISCARD};
static const Call GET_NOMINALS = {"fmi2GetNominalsOfContinuousStates", OUTSIDE_STEPS, STATUS_ERROR};
static const Call GET_INDICATORS = {"fmi2GetEventIndicators", INTEGRATED, STATUS_ERROR};

static void write_log(const Instance *instance, Status status, const char *category, const char *message) {
    const fmi2CallbackLogger logger = (fmi2CallbackLogger)instance->log_callback;
    if (logger) logger(instance->environment, instance->name, (fmi2Status)status, category, message);
}

/* What keeps an instance from being made, or NULL. */
static const char *instantiation_problem(fmi2String name, fmi2Type type, fmi2String token) {
    if (!name || name[strspn(name, " \t\r\n")] == '\0')
        return "fmi2Instantiate: instanceName must hold a character that is no white space";
    if (type != fmi2CoSimulation && type != fmi2ModelExchange)
        return "fmi2Instantiate: fmuType must be fmi2ModelExchange or fmi2CoSimulation";
    if (!token || strcmp(token, MODEL_TOKEN) != 0)
        return "fmi2Instantiate: fmuGUID is not that of this library; modelDescription.xml belongs to another build";
    return NULL;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token, fmi2String resource_location,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging_on) {
    (void)resource_location, (void)visible;
    const char *problem = instantiation_problem(name, type, token);
    Instance *instance = problem ? NULL : instance_new(name, type == fmi2ModelExchange);
    if (!instance) {
        char shown[PRINT_SIZE];
        instance_print(name ? name : "", shown);
        if (functions && functions->logger)
            functions->logger(functions->componentEnvironment, shown, fmi2Error, LOG_NAME_ERROR,
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
    if (!instance || !instance_admits(instance, &SETUP_EXPERIMENT)) return fmi2Error;
    return (fmi2Status)instance_set_experiment(instance, tolerance_defined != fmi2False, tolerance, start_time,
                                               stop_time_defined != fmi2False, stop_time);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component instance) {
    if (!instance || !instance_admits(instance, &ENTER_INITIALIZATION)) return fmi2Error;
    ((Instance *)instance)->now.state = INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component instance) {
    if (!instance || !instance_admits(instance, &EXIT_INITIALIZATION)) return fmi2Error;
    return (fmi2Status)instance_exit_initialization(instance);
}

fmi2Status fmi2Terminate(fmi2Component instance) {
    if (!instance || !instance_admits(instance, &TERMINATE)) return fmi2Error;
    instance_terminate(instance);
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component instance) {
    if (!instance || !instance_admits(instance, &RESET)) return fmi2Error;
    instance_reset(instance);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component instance, const fmi2ValueReference references[], size_t count,
                       fmi2Real values[]) {
    if (!instance) return fmi2Error;
    const Call *call = ((Instance *)instance)->now.model_exchange ? &GET_REAL_ME : &GET_REAL_CS;
    if (!instance_admits(instance, call)) return fmi2Error;
    return (fmi2Status)instance_get(instance, references, count, values);
}

fmi2Status fmi2SetReal(fmi2Component instance, const fmi2ValueReference references[], size_t count,
                       const fmi2Real values[]) {
    if (!instance || !instance_admits(instance, &SET_REAL)) return fmi2Error;
    return (fmi2Status)instance_set(instance, references, count, values);
}

#if DOCK_COUNT

fmi2Status fmi2GetBoolean(fmi2Component instance, const fmi2ValueReference references[], size_t count,
                          fmi2Boolean values[]) {
    static const Call call = {"fmi2GetBoolean", STARTED, STATUS_ERROR};
    if (!instance || !instance_admits(instance, &call)) return fmi2Error;
    const Status status = instance_check_booleans(instance, references, count, values);
    for (size_t i = 0; i < count && status == STATUS_OK; i++)
        values[i] = instance_get_boolean(instance, references[i]) ? fmi2True : fmi2False;
    return (fmi2Status)status;
}

fmi2Status fmi2SetBoolean(fmi2Component instance, const fmi2ValueReference references[], size_t count,
                          const fmi2Boolean values[]) {
    static const Call call = {"fmi2SetBoolean", BEFORE_START | RUNNING, STATUS_ERROR};
    if (!instance || !instance_admits(instance, &call)) return fmi2Error;
    Status status = instance_check_booleans(instance, references, count, values);
    for (size_t i = 0; i < count && status == STATUS_OK; i++)
        status = instance_check_boolean(instance, references[i], values[i] != fmi2False);
    for (size_t i = 0; i < count && status == STATUS_OK; i++)
        instance_set_boolean(instance, references[i], values[i] != fmi2False);
    return (fmi2Status)status;
}

#endif

fmi2Status fmi2DoStep(fmi2Component instance, fmi2Real time, fmi2Real step_size,
                      fmi2Boolean no_set_state_before_now) {
    (void)no_set_state_before_now;
    if (!instance || !instance_admits(instance, &DO_STEP)) return fmi2Error;
    bool ended_early;
    return (fmi2Status)solver_step(instance, time, step_size, &ended_early);
}

/* Answers a question about the last step that this FMU, whose steps are synchronous, has no answer to. */
static fmi2Status no_status(Instance *instance, const Call *call, fmi2StatusKind kind) {
    if (!instance || !instance_admits(instance, call)) return fmi2Error;
    return (fmi2Status)instance_refuse(instance, "there is no status of kind %d", (int)kind);
}

fmi2Status fmi2GetRealStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Real *value) {
    static const Call call = {"fmi2GetRealStatus", STEPPED, STATUS_DISCARD};
    if (kind != fmi2LastSuccessfulTime) return no_status(instance, &call, kind);
    if (!instance || !instance_admits(instance, &call)) return fmi2Error;
    if (!value) return (fmi2Status)instance_error(instance, "value is NULL");
    *value = ((Instance *)instance)->now.values[REFERENCE_TIME];
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Boolean *value) {
    static const Call call = {"fmi2GetBooleanStatus", STEPPED, STATUS_DISCARD};
    if (kind != fmi2Terminated) return no_status(instance, &call, kind);
    if (!instance || !instance_admits(instance, &call)) return fmi2Error;
    if (!value) return (fmi2Status)instance_error(instance, "value is NULL");
    *value = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Status *value) {
    static const Call call = {"fmi2GetStatus", STEPPED, STATUS_DISCARD};
    (void)value;
    return no_status(instance, &call, kind);
}

fmi2Status fmi2GetIntegerStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Integer *value) {
    static const Call call = {"fmi2GetIntegerStatus", STEPPED, STATUS_DISCARD};
    (void)value;
    return no_status(instance, &call, kind);
}

fmi2Status fmi2GetStringStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2String *value) {
    static const Call call = {"fmi2GetStringStatus", STEPPED, STATUS_DISCARD};
    (void)value;
    return no_status(instance, &call, kind);
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component instance, const fmi2ValueReference references[], size_t count,
                                        const fmi2Integer orders[], fmi2Real values[]) {
    if (!instance || !instance_admits(instance, &GET_OUTPUT_DERIVATIVES)) return fmi2Error;
    return (fmi2Status)derivatives_of_time(instance, references, count, orders, values);
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component instance, const fmi2ValueReference unknowns[],
                                        size_t unknown_count, const fmi2ValueReference knowns[], size_t known_count,
                                        const fmi2Real seed[], fmi2Real sensitivity[]) {
    if (!instance || !instance_admits(instance, &GET_DIRECTIONAL)) return fmi2Error;
    return (fmi2Status)derivatives_forward(instance, unknowns, unknown_count, knowns, known_count, seed, sensitivity);
}

fmi2Status fmi2GetFMUstate(fmi2Component instance, fmi2FMUstate *state) {
    if (!instance || !instance_admits(instance, &GET_STATE)) return fmi2Error;
    return (fmi2Status)saved_state_save(instance, state);
}

fmi2Status fmi2SetFMUstate(fmi2Component instance, fmi2FMUstate state) {
    if (!instance || !instance_admits(instance, &SET_STATE)) return fmi2Error;
    return (fmi2Status)saved_state_restore(instance, state);
}

fmi2Status fmi2FreeFMUstate(fmi2Component instance, fmi2FMUstate *state) {
    if (!instance || !instance_admits(instance, &FREE_STATE)) return fmi2Error;
    return (fmi2Status)saved_state_free(instance, state);
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component instance, fmi2FMUstate state, size_t *size) {
    if (!instance || !instance_admits(instance, &STATE_SIZE)) return fmi2Error;
    return (fmi2Status)saved_state_size(instance, state, size);
}

fmi2Status fmi2SerializeFMUstate(fmi2Component instance, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    if (!instance || !instance_admits(instance, &SERIALIZE)) return fmi2Error;
    return (fmi2Status)saved_state_serialize(instance, state, (unsigned char *)bytes, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component instance, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    if (!instance || !instance_admits(instance, &DESERIALIZE)) return fmi2Error;
    return (fmi2Status)saved_state_deserialize(instance, (const unsigned char *)bytes, size, state);
}

fmi2Status fmi2EnterEventMode(fmi2Component instance) {
    if (!instance || !instance_admits(instance, &ENTER_EVENT)) return fmi2Error;
    return (fmi2Status)changes_enter_event(instance);
}

fmi2Status fmi2NewDiscreteStates(fmi2Component instance, fmi2EventInfo *info) {
    if (!instance || !instance_admits(instance, &NEW_DISCRETE)) return fmi2Error;
    if (!info) return (fmi2Status)instance_error(instance, "the event info is NULL");
    memset(info, 0, sizeof *info);
    bool states_changed;
    const Status status = changes_end_event(instance, &states_changed);
    if (states_changed) info->valuesOfContinuousStatesChanged = fmi2True;
    return (fmi2Status)status;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component instance) {
    if (!instance || !instance_admits(instance, &ENTER_CONTINUOUS)) return fmi2Error;
    return (fmi2Status)changes_enter_continuous(instance);
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component instance, fmi2Boolean no_set_state_before_now,
                                       fmi2Boolean *enter_event_mode, fmi2Boolean *terminate) {
    (void)no_set_state_before_now;
    if (!instance || !instance_admits(instance, &COMPLETED_STEP)) return fmi2Error;
    if (!enter_event_mode || !terminate)
        return (fmi2Status)instance_error(instance, "an argument for a result is NULL");
    *enter_event_mode = *terminate = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component instance, fmi2Real time) {
    if (!instance || !instance_admits(instance, &SET_TIME)) return fmi2Error;
    return (fmi2Status)instance_set_time(instance, time);
}

fmi2Status fmi2SetContinuousStates(fmi2Component instance, const fmi2Real states[], size_t count) {
    if (!instance || !instance_admits(instance, &SET_STATES)) return fmi2Error;
    return (fmi2Status)instance_set_states(instance, states, count);
}

fmi2Status fmi2GetContinuousStates(fmi2Component instance, fmi2Real states[], size_t count) {
    if (!instance || !instance_admits(instance, &GET_STATES)) return fmi2Error;
    return (fmi2Status)instance_get_states(instance, states, count);
}

fmi2Status fmi2GetDerivatives(fmi2Component instance, fmi2Real rates[], size_t count) {
    if (!instance || !instance_admits(instance, &GET_RATES)) return fmi2Error;
    return (fmi2Status)instance_get_rates(instance, rates, count);
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component instance, fmi2Real nominals[], size_t count) {
    if (!instance || !instance_admits(instance, &GET_NOMINALS)) return fmi2Error;
    return (fmi2Status)instance_get_nominals(instance, nominals, count);
}

fmi2Status fmi2GetEventIndicators(fmi2Component instance, fmi2Real indicators[], size_t count) {
    (void)indicators;
    if (!instance || !instance_admits(instance, &GET_INDICATORS)) return fmi2Error;
    if (count != 0) return (fmi2Status)instance_error(instance, "ni = %zu: must be 0", count);
    return fmi2OK;
}
