#include "changes.h"

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MESSAGE_SIZE = 1024 };

static const struct {
    const char *name;
    unsigned categories;
} LOG_CATEGORIES[] = {
    {"logStatusDiscard", LOG_DISCARD},
    {"logStatusError", LOG_ERROR},
    {"logComposite", LOG_COMPOSITE},
    {"logAll", LOG_ALL},
};

/* Tolerances that an importer may ask for: what a scene may say, see supervessel/quantities.py. */
static const double LEAST_TOLERANCE = 1e-15;
static const double LARGEST_TOLERANCE = 0.1;

static const size_t LOG_CATEGORY_COUNT = sizeof LOG_CATEGORIES / sizeof LOG_CATEGORIES[0];

Instance *instance_new(const char *name, bool model_exchange) {
    const size_t length = strlen(name);
    Instance *instance = calloc(1, sizeof *instance + length + 1);
    if (!instance) return NULL;
    memcpy(instance->name, name, length + 1);
    instance->now.model_exchange = model_exchange;
    instance_reset(instance);
    return instance;
}

void instance_free(Instance *instance) {
    free(instance);
}

void instance_reset(Instance *instance) {
    const unsigned model_exchange = instance->now.model_exchange;
    memset(&instance->now, 0, sizeof instance->now);
    instance->now.state = INSTANTIATED;
    instance->now.model_exchange = model_exchange;
    instance_state_moved(instance);
    instance->now.tolerance = TOLERANCE;
    for (size_t i = 0; i < VARIABLE_COUNT; i++) instance->now.values[i] = VARIABLES[i].start;
    instance_start_rate(instance);
    instance_start_attitude(instance);
}

static void write_message(Instance *instance, Status status, LogCategory category, const char *format,
                          va_list arguments) {
    if (!(instance->log_categories & (unsigned)category)) return;
    char message[MESSAGE_SIZE];
    const int prefix = snprintf(message, sizeof message, "%s: ", instance->call->name);
    vsnprintf(message + prefix, sizeof message - (size_t)prefix, format, arguments);
    const char *name = "";
    for (size_t i = 0; i < LOG_CATEGORY_COUNT; i++)
        if (LOG_CATEGORIES[i].categories == (unsigned)category) name = LOG_CATEGORIES[i].name;
    instance->write_log(instance, status, name, message);
}

Status instance_error(Instance *instance, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    write_message(instance, STATUS_ERROR, LOG_ERROR, format, arguments);
    va_end(arguments);
    instance_terminate(instance);
    return STATUS_ERROR;
}

Status instance_refuse(Instance *instance, const char *format, ...) {
    const Status status = instance->call->refusal;
    va_list arguments;
    va_start(arguments, format);
    write_message(instance, status, status == STATUS_ERROR ? LOG_ERROR : LOG_DISCARD, format, arguments);
    va_end(arguments);
    if (status == STATUS_ERROR) instance_terminate(instance);
    return status;
}

void instance_inform(Instance *instance, LogCategory category, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    write_message(instance, STATUS_OK, category, format, arguments);
    va_end(arguments);
}

static const char *state_in_words(unsigned state) {
    switch (state) {
        case INSTANTIATED: return "before initialisation";
        case INITIALIZATION: return "during initialisation";
        case STEPPING: return "between steps";
        case INTERMEDIATE: return "within a step";
        case EVENT: return "in event mode";
        case CONTINUOUS: return "in continuous-time mode";
        default: return "after termination or an error";
    }
}

bool instance_admits(Instance *instance, const Call *call) {
    instance->call = call;
    const unsigned other = instance->now.model_exchange ? ONLY_CO_SIMULATION : ONLY_MODEL_EXCHANGE;
    const unsigned state = instance->within_step ? INTERMEDIATE : instance->now.state;
    if ((state & call->states) && !(call->states & other)) return true;
    if (!(state & call->states))
        instance_error(instance, "must not be called %s", state_in_words(state));
    else
        instance_error(instance, "must not be called in %s",
                       instance->now.model_exchange ? "model exchange" : "co-simulation");
    return false;
}

Status instance_set_logging(Instance *instance, bool on, size_t count, const char *const names[]) {
    if (count > 0 && !names) return instance_error(instance, "categories is NULL");
    unsigned categories = on && count == 0 ? LOG_ALL : 0;
    for (size_t i = 0; i < count; i++) {
        size_t k = 0;
        while (k < LOG_CATEGORY_COUNT && !(names[i] && strcmp(names[i], LOG_CATEGORIES[k].name) == 0)) k++;
        if (k == LOG_CATEGORY_COUNT)
            return instance_error(instance, "category %zu is not one of the model description's", i + 1);
        categories |= LOG_CATEGORIES[k].categories;
    }
    instance->log_categories = on ? categories : 0;
    return STATUS_OK;
}

Status instance_set_experiment(Instance *instance, bool tolerance_defined, double tolerance, double start_time,
                               bool stop_time_defined, double stop_time) {
    if (!isfinite(start_time)) return instance_error(instance, "startTime = %.10g s: must be finite", start_time);
    if (stop_time_defined && !(stop_time >= start_time))
        return instance_error(instance, "stopTime = %.10g s: must not be before startTime = %.10g s", stop_time,
                              start_time);
    tolerance_defined = tolerance_defined && STEPS >= STEPS_BY_ERROR && !instance->now.model_exchange;
    if (tolerance_defined && !(tolerance >= LEAST_TOLERANCE && tolerance <= LARGEST_TOLERANCE))
        return instance_error(instance, "tolerance = %.10g: must be from %g to %g", tolerance, LEAST_TOLERANCE,
                              LARGEST_TOLERANCE);
    instance->now.tolerance = tolerance_defined ? tolerance : TOLERANCE;
    instance->now.values[REFERENCE_TIME] = start_time;
    instance->now.start_time = start_time;
    instance->now.stop_time = stop_time;
    instance->now.stop_time_defined = stop_time_defined;
    return STATUS_OK;
}

Status instance_start_attitude(Instance *instance) {
    const double *attitude = &instance->now.values[REFERENCE_ATTITUDE_START];
    double largest = 0.0, square = 0.0;
    for (size_t i = 0; i < 4; i++) largest = fmax(largest, fabs(attitude[i]));
    if (largest == 0.0)
        return instance_refuse(instance, "attitude_start = (0, 0, 0, 0): must have a length greater than 0");
    for (size_t i = 0; i < 4; i++) square += (attitude[i] / largest) * (attitude[i] / largest);
    /* what is at unit length within rounding stays as it is: nothing is gained by rounding once more */
    const double plain = attitude[0] * attitude[0] + attitude[1] * attitude[1] + attitude[2] * attitude[2] +
                         attitude[3] * attitude[3];
    const bool is_unit = fabs(plain - 1.0) <= 4.0 * DBL_EPSILON;
    double *x = instance_x(instance);
    for (size_t i = 0; i < 4; i++) x[i] = is_unit ? attitude[i] : attitude[i] / largest / sqrt(square);
    instance_state_moved(instance);
    return STATUS_OK;
}

void instance_start_rate(Instance *instance) {
    memcpy(instance_x(instance) + 4, &instance->now.values[REFERENCE_RATE_START], 3 * sizeof(double));
    instance_state_moved(instance);
}

Status instance_exit_initialization(Instance *instance) {
    instance_start_rate(instance);
    Status status = instance_start_attitude(instance);
    if (status == STATUS_OK) status = composite_refresh(instance);
    if (status != STATUS_OK) return status;
#if CHANGES
    changes_commit(instance);
#else
    memcpy(instance->now.stepped_p, instance->now.p, sizeof instance->now.p);
#endif
    instance->now.state = instance->now.model_exchange ? EVENT : STEPPING;
#if STATE_IS_MOMENTUM
    instance_state_moved(instance); /* where the states lead now, the rate follows from them as it will ever after */
#endif
    return STATUS_OK;
}
