/* The functions of FMI 3.0 that this FMU supports: co-simulation and model exchange. The others are in
   fmi3_unsupported.c. */
#include "fmi3Functions.h"

#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "booleans.h"
#include "changes.h"
#include "derivatives.h"
#include "saved_state.h"
#include "solver.h"

enum { REPORT_SIZE = 256 };

/* Co-simulation has an event mode where docks open and close. */
enum {
    HAS_EVENT_MODE = DOCK_COUNT > 0,
    EVENT_FOLLOWS = HAS_EVENT_MODE ? STEPPING | CONTINUOUS : CONTINUOUS,
    ONLY_EXCHANGE = HAS_EVENT_MODE ? ONLY_MODEL_EXCHANGE : 0
};

enum {
    OUTSIDE_CALLBACK = ANY_STATE & ~INTERMEDIATE,
    STARTED = INITIALIZATION | RUNNING | TERMINATED,
    OUTSIDE_STEPS = ONLY_MODEL_EXCHANGE | (ANY_STATE & ~STEPPING & ~INTERMEDIATE),
    STEPPED = ONLY_CO_SIMULATION | STEPPING | TERMINATED,
    INTEGRATED = ONLY_MODEL_EXCHANGE | INITIALIZATION | EVENT | CONTINUOUS | TERMINATED
};

static const Call INSTANTIATE_CS = {"fmi3InstantiateCoSimulation", ANY_STATE, STATUS_ERROR};
static const Call INSTANTIATE_ME = {"fmi3InstantiateModelExchange", ANY_STATE, STATUS_ERROR};
static const Call SET_DEBUG_LOGGING = {"fmi3SetDebugLogging", OUTSIDE_CALLBACK, STATUS_ERROR};
static const Call RESET = {"fmi3Reset", OUTSIDE_CALLBACK, STATUS_ERROR};
static const Call ENTER_INITIALIZATION = {"fmi3EnterInitializationMode", INSTANTIATED, STATUS_ERROR};
static const Call EXIT_INITIALIZATION = {"fmi3ExitInitializationMode", INITIALIZATION, STATUS_DISCARD};
static const Call TERMINATE = {"fmi3Terminate", RUNNING, STATUS_ERROR};
static const Call GET_FLOAT64 = {"fmi3GetFloat64", ANY_STATE, STATUS_DISCARD};
static const Call SET_FLOAT64 = {"fmi3SetFloat64", BEFORE_START | RUNNING, STATUS_DISCARD};
static const Call DO_STEP = {"fmi3DoStep", STEPPING, STATUS_DISCARD};
static const Call GET_OUTPUT_DERIVATIVES = {"fmi3GetOutputDerivatives", STEPPED | INTERMEDIATE,
                                            STATUS_DISCARD};
static const Call GET_DIRECTIONAL = {"fmi3GetDirectionalDerivative", STARTED, STATUS_DISCARD};
static const Call GET_ADJOINT = {"fmi3GetAdjointDerivative", STARTED, STATUS_DISCARD};
static const Call GET_STATE = {"fmi3GetFMUState", OUTSIDE_CALLBACK, STATUS_ERROR};
static const Call SET_STATE = {"fmi3SetFMUState", OUTSIDE_CALLBACK, STATUS_ERROR};
static const Call FREE_STATE = {"fmi3FreeFMUState", OUTSIDE_CALLBACK, STATUS_ERROR};
static const Call STATE_SIZE = {"fmi3SerializedFMUStateSize", OUTSIDE_CALLBACK, STATUS_ERROR};
static const Call SERIALIZE = {"fmi3SerializeFMUState", OUTSIDE_CALLBACK, STATUS_ERROR};
static const Call DESERIALIZE = {"fmi3DeserializeFMUState", OUTSIDE_CALLBACK, STATUS_ERROR};
static const Call ENTER_EVENT = {"fmi3EnterEventMode", EVENT_FOLLOWS, STATUS_DISCARD};
static const Call UPDATE_DISCRETE = {"fmi3UpdateDiscreteStates", EVENT, STATUS_DISCARD};
static const Call ENTER_CONTINUOUS = {"fmi3EnterContinuousTimeMode", ONLY_EXCHANGE | EVENT, STATUS_DISCARD};
static const Call COMPLETED_STEP = {"fmi3CompletedIntegratorStep", CONTINUOUS, STATUS_ERROR};
static const Call SET_TIME = {"fmi3SetTime", ONLY_EXCHANGE | CONTINUOUS | EVENT, STATUS_DISCARD};
static const Call SET_STATES = {"fmi3SetContinuousStates", CONTINUOUS, STATUS_DISCARD};
static const Call GET_STATES = {"fmi3GetContinuousStates", INTEGRATED, STATUS_DISCARD};
static const Call GET_RATES = {"fmi3GetContinuousStateDerivatives", INTEGRATED, STATUS_DISCARD};
static const Call GET_NOMINALS = {"fmi3GetNominalsOfContinuousStates", OUTSIDE_STEPS, STATUS_ERROR};
static const Call GET_INDICATORS = {"fmi3GetEventIndicators", INTEGRATED, STATUS_ERROR};
static const Call COUNT_STATES = {"fmi3GetNumberOfContinuousStates", ONLY_MODEL_EXCHANGE | ANY_STATE, STATUS_ERROR};
static const Call COUNT_INDICATORS = {"fmi3GetNumberOfEventIndicators", ONLY_MODEL_EXCHANGE | ANY_STATE, STATUS_ERROR};

static void write_log(const Instance *instance, Status status, const char *category, const char *message) {
    const fmi3LogMessageCallback log_message = (fmi3LogMessageCallback)instance->log_callback;
    if (log_message) log_message(instance->environment, (fmi3Status)status, category, message);
}

static bool sub_step_ended(Instance *instance, double *end) {
    const fmi3IntermediateUpdateCallback update = (fmi3IntermediateUpdateCallback)instance->sub_step_callback;
    fmi3Boolean return_requested = fmi3False;
    fmi3Float64 return_time = instance->now.values[REFERENCE_TIME];
    update(instance->environment, return_time, fmi3False, fmi3True, fmi3True, instance->early_return_allowed,
           &return_requested, &return_time);
    *end = return_time;
    return return_requested;
}

/* Logs why there is no instance. */
static void report(fmi3InstanceEnvironment environment, fmi3LogMessageCallback log_message, const Call *call,
                   const char *problem) {
    if (!log_message) return;
    char message[REPORT_SIZE];
    snprintf(message, sizeof message, "%s: %s", call->name, problem);
    log_message(environment, fmi3Error, LOG_NAME_ERROR, message);
}

/* What keeps an instance from being made, or NULL. */
static const char *instantiation_problem(fmi3String name, fmi3String token) {
    if (!name || name[strspn(name, " \t\r\n")] == '\0')
        return "instanceName must hold a character that is no white space";
    if (!token || strcmp(token, MODEL_TOKEN) != 0)
        return "instantiationToken is not that of this library; modelDescription.xml belongs to another build";
    return NULL;
}

static Instance *instantiate(const Call *call, fmi3String name, fmi3String token, bool logging_on,
                             fmi3InstanceEnvironment environment, fmi3LogMessageCallback log_message) {
    const char *problem = instantiation_problem(name, token);
    Instance *instance = problem ? NULL : instance_new(name, call == &INSTANTIATE_ME);
    if (!instance) {
        report(environment, log_message, call, problem ? problem : "out of memory");
        return NULL;
    }
    instance->call = call;
    instance->environment = environment;
    instance->log_callback = (void (*)(void))log_message;
    instance->write_log = write_log;
    instance->log_categories = logging_on ? LOG_ALL : 0;
    return instance;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resource_path,
                                          fmi3Boolean visible, fmi3Boolean logging_on,
                                          fmi3InstanceEnvironment environment, fmi3LogMessageCallback log_message) {
    (void)resource_path, (void)visible;
    return instantiate(&INSTANTIATE_ME, name, token, logging_on, environment, log_message);
}

/* Whether there is event mode if it is asked for, and the variables to be read within a step are outputs. */
static const char *co_simulation_problem(bool event_mode_used, const fmi3ValueReference variables[], size_t count) {
    if (event_mode_used && !HAS_EVENT_MODE)
        return "eventModeUsed is true, but this FMU has no event mode (hasEventMode is false)";
    if (count > 0 && !variables) return "requiredIntermediateVariables is NULL";
    for (size_t i = 0; i < count; i++)
        if (variables[i] >= VARIABLE_COUNT || VARIABLES[variables[i]].role != ROLE_OUTPUT)
            return "requiredIntermediateVariables holds a reference that is no output";
    return NULL;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resource_path,
                                         fmi3Boolean visible, fmi3Boolean logging_on, fmi3Boolean event_mode_used,
                                         fmi3Boolean early_return_allowed,
                                         const fmi3ValueReference intermediate_variables[], size_t intermediate_count,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log_message,
                                         fmi3IntermediateUpdateCallback intermediate_update) {
    (void)resource_path, (void)visible;
    const char *problem = co_simulation_problem(event_mode_used, intermediate_variables, intermediate_count);
    if (problem) {
        report(environment, log_message, &INSTANTIATE_CS, problem);
        return NULL;
    }
    Instance *instance = instantiate(&INSTANTIATE_CS, name, token, logging_on, environment, log_message);
    if (!instance) return NULL;
    if (HAS_EVENT_MODE) instance->event_mode_used = event_mode_used;
    instance->early_return_allowed = early_return_allowed;
    instance->sub_step_callback = (void (*)(void))intermediate_update;
    instance->sub_step_ended = intermediate_update ? sub_step_ended : NULL;
    return instance;
}

void fmi3FreeInstance(fmi3Instance instance) {
    instance_free(instance);
}

const char *fmi3GetVersion(void) {
    return fmi3Version;
}

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean on, size_t count, const fmi3String categories[]) {
    if (!instance || !instance_admits(instance, &SET_DEBUG_LOGGING)) return fmi3Error;
    return (fmi3Status)instance_set_logging(instance, on, count, categories);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start_time, fmi3Boolean stop_time_defined, fmi3Float64 stop_time) {
    if (!instance || !instance_admits(instance, &ENTER_INITIALIZATION)) return fmi3Error;
    const Status status = instance_set_experiment(instance, tolerance_defined, tolerance, start_time,
                                                  stop_time_defined, stop_time);
    if (status == STATUS_OK) ((Instance *)instance)->now.state = INITIALIZATION;
    return (fmi3Status)status;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    if (!instance || !instance_admits(instance, &EXIT_INITIALIZATION)) return fmi3Error;
    const Status status = instance_exit_initialization(instance);
    if (HAS_EVENT_MODE && status == STATUS_OK && ((Instance *)instance)->event_mode_used)
        ((Instance *)instance)->now.state = EVENT;
    return (fmi3Status)status;
}

fmi3Status fmi3Terminate(fmi3Instance instance) {
    if (!instance || !instance_admits(instance, &TERMINATE)) return fmi3Error;
    instance_terminate(instance);
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance) {
    if (!instance || !instance_admits(instance, &RESET)) return fmi3Error;
    instance_reset(instance);
    return fmi3OK;
}

static fmi3Status wrong_size(Instance *instance, size_t value_count, size_t count) {
    return (fmi3Status)instance_error(instance, "nValues = %zu: must be nValueReferences = %zu", value_count, count);
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                          fmi3Float64 values[], size_t value_count) {
    if (!instance || !instance_admits(instance, &GET_FLOAT64)) return fmi3Error;
    if (value_count != count) return wrong_size(instance, value_count, count);
    return (fmi3Status)instance_get(instance, references, count, values);
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                          const fmi3Float64 values[], size_t value_count) {
    if (!instance || !instance_admits(instance, &SET_FLOAT64)) return fmi3Error;
    if (value_count != count) return wrong_size(instance, value_count, count);
    return (fmi3Status)instance_set(instance, references, count, values);
}

#if DOCK_COUNT

fmi3Status fmi3GetBoolean(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                          fmi3Boolean values[], size_t value_count) {
    static const Call call = {"fmi3GetBoolean", ANY_STATE, STATUS_ERROR};
    if (!instance || !instance_admits(instance, &call)) return fmi3Error;
    if (value_count != count) return wrong_size(instance, value_count, count);
    const Status status = instance_check_booleans(instance, references, count, values);
    for (size_t i = 0; i < count && status == STATUS_OK; i++)
        values[i] = instance_get_boolean(instance, references[i]);
    return (fmi3Status)status;
}

fmi3Status fmi3SetBoolean(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                          const fmi3Boolean values[], size_t value_count) {
    static const Call call = {"fmi3SetBoolean", BEFORE_START | RUNNING, STATUS_ERROR};
    if (!instance || !instance_admits(instance, &call)) return fmi3Error;
    if (value_count != count) return wrong_size(instance, value_count, count);
    Status status = instance_check_booleans(instance, references, count, values);
    for (size_t i = 0; i < count && status == STATUS_OK; i++)
        status = instance_check_boolean(instance, references[i], values[i]);
    for (size_t i = 0; i < count && status == STATUS_OK; i++)
        instance_set_boolean(instance, references[i], values[i]);
    return (fmi3Status)status;
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance) {
    static const Call call = {"fmi3EnterStepMode", ONLY_CO_SIMULATION | EVENT, STATUS_ERROR};
    if (!instance || !instance_admits(instance, &call)) return fmi3Error;
    ((Instance *)instance)->now.state = STEPPING;
    return fmi3OK;
}

#endif

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 time, fmi3Float64 step_size,
                      fmi3Boolean no_set_state_before_now, fmi3Boolean *event_handling_needed,
                      fmi3Boolean *terminate_simulation, fmi3Boolean *early_return,
                      fmi3Float64 *last_successful_time) {
    (void)no_set_state_before_now;
    if (!instance || !instance_admits(instance, &DO_STEP)) return fmi3Error;
    if (!event_handling_needed || !terminate_simulation || !early_return || !last_successful_time)
        return (fmi3Status)instance_error(instance, "an argument for a result is NULL");
    bool ended_early;
    const Status status = solver_step(instance, time, step_size, &ended_early);
    *event_handling_needed = *terminate_simulation = fmi3False;
    *early_return = ended_early;
    *last_successful_time = ((Instance *)instance)->now.values[REFERENCE_TIME];
    return (fmi3Status)status;
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                                    const fmi3Int32 orders[], fmi3Float64 values[], size_t value_count) {
    if (!instance || !instance_admits(instance, &GET_OUTPUT_DERIVATIVES)) return fmi3Error;
    if (value_count != count) return wrong_size(instance, value_count, count);
    return (fmi3Status)derivatives_of_time(instance, references, count, orders, values);
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                        size_t unknown_count, const fmi3ValueReference knowns[], size_t known_count,
                                        const fmi3Float64 seed[], size_t seed_count, fmi3Float64 sensitivity[],
                                        size_t sensitivity_count) {
    if (!instance || !instance_admits(instance, &GET_DIRECTIONAL)) return fmi3Error;
    if (seed_count != known_count || sensitivity_count != unknown_count)
        return (fmi3Status)instance_error(instance, "nSeed = %zu, nSensitivity = %zu: must be %zu and %zu", seed_count,
                                          sensitivity_count, known_count, unknown_count);
    return (fmi3Status)derivatives_forward(instance, unknowns, unknown_count, knowns, known_count, seed, sensitivity);
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t unknown_count,
                                    const fmi3ValueReference knowns[], size_t known_count, const fmi3Float64 seed[],
                                    size_t seed_count, fmi3Float64 sensitivity[], size_t sensitivity_count) {
    if (!instance || !instance_admits(instance, &GET_ADJOINT)) return fmi3Error;
    if (seed_count != unknown_count || sensitivity_count != known_count)
        return (fmi3Status)instance_error(instance, "nSeed = %zu, nSensitivity = %zu: must be %zu and %zu", seed_count,
                                          sensitivity_count, unknown_count, known_count);
    return (fmi3Status)derivatives_adjoint(instance, unknowns, unknown_count, knowns, known_count, seed, sensitivity);
}

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state) {
    if (!instance || !instance_admits(instance, &GET_STATE)) return fmi3Error;
    return (fmi3Status)saved_state_save(instance, state);
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state) {
    if (!instance || !instance_admits(instance, &SET_STATE)) return fmi3Error;
    return (fmi3Status)saved_state_restore(instance, state);
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state) {
    if (!instance || !instance_admits(instance, &FREE_STATE)) return fmi3Error;
    return (fmi3Status)saved_state_free(instance, state);
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t *size) {
    if (!instance || !instance_admits(instance, &STATE_SIZE)) return fmi3Error;
    return (fmi3Status)saved_state_size(instance, state, size);
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    if (!instance || !instance_admits(instance, &SERIALIZE)) return fmi3Error;
    return (fmi3Status)saved_state_serialize(instance, state, bytes, size);
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
    if (!instance || !instance_admits(instance, &DESERIALIZE)) return fmi3Error;
    return (fmi3Status)saved_state_deserialize(instance, bytes, size, state);
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance) {
    if (!instance || !instance_admits(instance, &ENTER_EVENT)) return fmi3Error;
    if (HAS_EVENT_MODE && ((Instance *)instance)->now.state == STEPPING && !((Instance *)instance)->event_mode_used)
        return (fmi3Status)instance_error(instance, "eventModeUsed was false when the instance was made");
    return (fmi3Status)changes_enter_event(instance);
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *need_update, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals_changed, fmi3Boolean *values_changed,
                                    fmi3Boolean *next_event_time_defined, fmi3Float64 *next_event_time) {
    if (!instance || !instance_admits(instance, &UPDATE_DISCRETE)) return fmi3Error;
    if (!need_update || !terminate || !nominals_changed || !values_changed || !next_event_time_defined ||
        !next_event_time)
        return (fmi3Status)instance_error(instance, "an argument for a result is NULL");
    *need_update = *terminate = *nominals_changed = *values_changed = *next_event_time_defined = fmi3False;
    bool states_changed;
    const Status status = changes_end_event(instance, &states_changed);
    if (states_changed) *values_changed = fmi3True;
    return (fmi3Status)status;
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
    if (!instance || !instance_admits(instance, &ENTER_CONTINUOUS)) return fmi3Error;
    return (fmi3Status)changes_enter_continuous(instance);
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean no_set_state_before_now,
                                       fmi3Boolean *enter_event_mode, fmi3Boolean *terminate) {
    (void)no_set_state_before_now;
    if (!instance || !instance_admits(instance, &COMPLETED_STEP)) return fmi3Error;
    if (!enter_event_mode || !terminate)
        return (fmi3Status)instance_error(instance, "an argument for a result is NULL");
    *enter_event_mode = *terminate = fmi3False;
    return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time) {
    if (!instance || !instance_admits(instance, &SET_TIME)) return fmi3Error;
    return (fmi3Status)instance_set_time(instance, time);
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 states[], size_t count) {
    if (!instance || !instance_admits(instance, &SET_STATES)) return fmi3Error;
    return (fmi3Status)instance_set_states(instance, states, count);
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 states[], size_t count) {
    if (!instance || !instance_admits(instance, &GET_STATES)) return fmi3Error;
    return (fmi3Status)instance_get_states(instance, states, count);
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 rates[], size_t count) {
    if (!instance || !instance_admits(instance, &GET_RATES)) return fmi3Error;
    return (fmi3Status)instance_get_rates(instance, rates, count);
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[], size_t count) {
    if (!instance || !instance_admits(instance, &GET_NOMINALS)) return fmi3Error;
    return (fmi3Status)instance_get_nominals(instance, nominals, count);
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 indicators[], size_t count) {
    (void)indicators;
    if (!instance || !instance_admits(instance, &GET_INDICATORS)) return fmi3Error;
    if (count != 0) return (fmi3Status)instance_error(instance, "nEventIndicators = %zu: must be 0", count);
    return fmi3OK;
}

static fmi3Status give_count(Instance *instance, const Call *call, size_t count, size_t *result) {
    if (!instance || !instance_admits(instance, call)) return fmi3Error;
    if (!result) return (fmi3Status)instance_error(instance, "the argument for the result is NULL");
    *result = count;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *count) {
    return give_count(instance, &COUNT_INDICATORS, 0, count);
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *count) {
    return give_count(instance, &COUNT_STATES, STATE_COUNT, count);
}
