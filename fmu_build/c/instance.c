#include "instance.h"

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

static const size_t LOG_CATEGORY_COUNT = sizeof LOG_CATEGORIES / sizeof LOG_CATEGORIES[0];

Instance *instance_new(const char *name) {
    const size_t length = strlen(name);
    Instance *instance = calloc(1, sizeof *instance + length + 1);
    if (!instance) return NULL;
    memcpy(instance->name, name, length + 1);
    instance_reset(instance);
    return instance;
}

void instance_free(Instance *instance) {
    free(instance);
}

void instance_reset(Instance *instance) {
    instance->state = INSTANTIATED;
    instance->time = instance->stop_time = 0.0;
    instance->stop_time_defined = false;
    instance->composite_is_current = instance->outputs_are_current = false;
    for (size_t i = 0; i < VARIABLE_COUNT; i++) instance->values[i] = VARIABLES[i].start;
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
    instance->state = TERMINATED;
    return STATUS_ERROR;
}

Status instance_refuse(Instance *instance, const char *format, ...) {
    const Status status = instance->call->refusal;
    va_list arguments;
    va_start(arguments, format);
    write_message(instance, status, status == STATUS_ERROR ? LOG_ERROR : LOG_DISCARD, format, arguments);
    va_end(arguments);
    if (status == STATUS_ERROR) instance->state = TERMINATED;
    return status;
}

void instance_inform(Instance *instance, LogCategory category, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    write_message(instance, STATUS_OK, category, format, arguments);
    va_end(arguments);
}

bool instance_admits(Instance *instance, const Call *call) {
    instance->call = call;
    if (instance->state & call->states) return true;
    const char *state = instance->state == INSTANTIATED     ? "before initialisation"
                        : instance->state == INITIALIZATION ? "during initialisation"
                        : instance->state == STEPPING       ? "between steps"
                                                            : "after termination or an error";
    instance_error(instance, "must not be called %s", state);
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

Status instance_set_times(Instance *instance, double start_time, bool stop_time_defined, double stop_time) {
    if (!isfinite(start_time)) return instance_error(instance, "startTime = %.10g s: must be finite", start_time);
    if (stop_time_defined && !(stop_time >= start_time))
        return instance_error(instance, "stopTime = %.10g s: must not be before startTime = %.10g s", stop_time,
                              start_time);
    instance->time = start_time;
    instance->stop_time = stop_time;
    instance->stop_time_defined = stop_time_defined;
    return STATUS_OK;
}

Status instance_start_state(Instance *instance) {
    const double *attitude = &instance->values[REFERENCE_ATTITUDE_START];
    double largest = 0.0, square = 0.0;
    for (size_t i = 0; i < 4; i++) largest = fmax(largest, fabs(attitude[i]));
    if (largest == 0.0)
        return instance_refuse(instance, "attitude_start = (0, 0, 0, 0): must have a length greater than 0");
    for (size_t i = 0; i < 4; i++) square += (attitude[i] / largest) * (attitude[i] / largest);
    for (size_t i = 0; i < 4; i++) instance->x[i] = attitude[i] / largest / sqrt(square);
    memcpy(&instance->x[4], &instance->values[REFERENCE_RATE_START], 3 * sizeof(double));
    return STATUS_OK;
}

Status instance_exit_initialization(Instance *instance) {
    Status status = instance_start_state(instance);
    if (status == STATUS_OK) status = composite_refresh(instance);
    if (status == STATUS_OK) instance->state = STEPPING;
    instance->outputs_are_current = false;
    return status;
}
