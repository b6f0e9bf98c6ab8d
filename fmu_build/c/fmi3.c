/* The functions of FMI 3.0 that this FMU supports: co-simulation. The others are in fmi3_unsupported.c. */
#include "fmi3Functions.h"

#include <stddef.h>
#include <string.h>

#include "instance.h"

enum { ANY_STATE = INSTANTIATED | INITIALIZATION | STEPPING | TERMINATED };

static const Call INSTANTIATE = {"fmi3InstantiateCoSimulation", ANY_STATE, STATUS_ERROR};
static const Call SET_DEBUG_LOGGING = {"fmi3SetDebugLogging", ANY_STATE, STATUS_ERROR};
static const Call ENTER_INITIALIZATION = {"fmi3EnterInitializationMode", INSTANTIATED, STATUS_ERROR};
static const Call EXIT_INITIALIZATION = {"fmi3ExitInitializationMode", INITIALIZATION, STATUS_DISCARD};
static const Call TERMINATE = {"fmi3Terminate", STEPPING, STATUS_ERROR};
static const Call GET_FLOAT64 = {"fmi3GetFloat64", ANY_STATE, STATUS_DISCARD};
static const Call SET_FLOAT64 = {"fmi3SetFloat64", INSTANTIATED | INITIALIZATION | STEPPING, STATUS_DISCARD};
static const Call DO_STEP = {"fmi3DoStep", STEPPING, STATUS_DISCARD};

static void write_log(const Instance *instance, Status status, const char *category, const char *message) {
    const fmi3LogMessageCallback log_message = (fmi3LogMessageCallback)instance->log_callback;
    if (log_message) log_message(instance->environment, (fmi3Status)status, category, message);
}

/* What keeps an instance from being made, or NULL. */
static const char *instantiation_problem(fmi3String token, fmi3Boolean event_mode_used, size_t intermediate_count) {
    if (!token || strcmp(token, MODEL_TOKEN) != 0)
        return "fmi3InstantiateCoSimulation: instantiationToken is not that of this library; modelDescription.xml belongs to another build";
    if (event_mode_used) return "fmi3InstantiateCoSimulation: eventModeUsed is true, but this FMU has no event mode (hasEventMode is false)";
    if (intermediate_count > 0)
        return "fmi3InstantiateCoSimulation: requiredIntermediateVariables is not empty, but this FMU has no intermediate update";
    return NULL;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resource_path,
                                         fmi3Boolean visible, fmi3Boolean logging_on, fmi3Boolean event_mode_used,
                                         fmi3Boolean early_return_allowed,
                                         const fmi3ValueReference intermediate_variables[], size_t intermediate_count,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log_message,
                                         fmi3IntermediateUpdateCallback intermediate_update) {
    (void)resource_path, (void)visible, (void)early_return_allowed, (void)intermediate_variables;
    (void)intermediate_update;
    const char *problem = !name || name[strspn(name, " \t\r\n")] == '\0'
                              ? "fmi3InstantiateCoSimulation: instanceName must hold a character that is no white space"
                              : instantiation_problem(token, event_mode_used, intermediate_count);
    Instance *instance = problem ? NULL : instance_new(name);
    if (!instance) {
        if (log_message) log_message(environment, fmi3Error, "logStatusError", problem ? problem : "out of memory");
        return NULL;
    }
    instance->call = &INSTANTIATE;
    instance->environment = environment;
    instance->log_callback = (void (*)(void))log_message;
    instance->write_log = write_log;
    instance->log_categories = logging_on ? LOG_ALL : 0;
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
    (void)tolerance_defined, (void)tolerance;
    if (!instance || !instance_admits(instance, &ENTER_INITIALIZATION)) return fmi3Error;
    const Status status = instance_set_times(instance, start_time, stop_time_defined, stop_time);
    if (status == STATUS_OK) ((Instance *)instance)->state = INITIALIZATION;
    return (fmi3Status)status;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    if (!instance || !instance_admits(instance, &EXIT_INITIALIZATION)) return fmi3Error;
    return (fmi3Status)instance_exit_initialization(instance);
}

fmi3Status fmi3Terminate(fmi3Instance instance) {
    if (!instance || !instance_admits(instance, &TERMINATE)) return fmi3Error;
    ((Instance *)instance)->state = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance) {
    if (!instance) return fmi3Error;
    instance_reset(instance);
    return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                          fmi3Float64 values[], size_t value_count) {
    if (!instance || !instance_admits(instance, &GET_FLOAT64)) return fmi3Error;
    if (value_count != count)
        return (fmi3Status)instance_error(instance, "nValues = %zu: must be nValueReferences = %zu", value_count,
                                          count);
    return (fmi3Status)instance_get(instance, references, count, values);
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
                          const fmi3Float64 values[], size_t value_count) {
    if (!instance || !instance_admits(instance, &SET_FLOAT64)) return fmi3Error;
    if (value_count != count)
        return (fmi3Status)instance_error(instance, "nValues = %zu: must be nValueReferences = %zu", value_count,
                                          count);
    return (fmi3Status)instance_set(instance, references, count, values);
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 time, fmi3Float64 step_size,
                      fmi3Boolean no_set_state_before_now, fmi3Boolean *event_handling_needed,
                      fmi3Boolean *terminate_simulation, fmi3Boolean *early_return,
                      fmi3Float64 *last_successful_time) {
    (void)no_set_state_before_now;
    if (!instance || !instance_admits(instance, &DO_STEP)) return fmi3Error;
    if (!event_handling_needed || !terminate_simulation || !early_return || !last_successful_time)
        return (fmi3Status)instance_error(instance, "an argument for a result is NULL");
    const Status status = solver_step(instance, time, step_size);
    *event_handling_needed = *terminate_simulation = *early_return = fmi3False;
    *last_successful_time = ((Instance *)instance)->time;
    return (fmi3Status)status;
}
