#include "instance.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MESSAGE_SIZE = 256 };

static const char *const names[VARIABLE_COUNT] = NAMES;
static const double start[INPUT_COUNT] = START;
static const size_t places[ARGUMENT_COUNT + RESULT_COUNT] = PLACES;

/* CasADi's: reads its arguments through arg, writes its results through res. */
int FUNCTION(const double **arg, double **res, int *iw, double *w, int mem);

Instance *instance_new(const char *name, const char *token) {
    if (!name || !token || strcmp(token, TOKEN) != 0) return NULL;
    const size_t length = strlen(name);
    Instance *instance = calloc(1, sizeof *instance + length + 1);
    if (!instance) return NULL;
    memcpy(instance->name, name, length + 1);
    instance_reset(instance);
    return instance;
}

void instance_reset(Instance *instance) {
    memset(instance->values, 0, sizeof instance->values);
    memcpy(&instance->values[1], start, sizeof start);
    instance->state = INSTANTIATED;
    instance->current = false;
}

static void write_message(Instance *instance, Status status, const char *format, va_list arguments) {
    if (!instance->logging) return;
    char message[MESSAGE_SIZE];
    const int prefix = snprintf(message, sizeof message, "%s: ", instance->call->name);
    vsnprintf(message + prefix, sizeof message - (size_t)prefix, format, arguments);
    instance->write_log(instance, status, status == STATUS_ERROR ? "logStatusError" : "logStatusDiscard", message);
}

Status instance_error(Instance *instance, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    write_message(instance, STATUS_ERROR, format, arguments);
    va_end(arguments);
    instance->state = TERMINATED;
    return STATUS_ERROR;
}

/* Logs that a value cannot be used and returns the call's refusal. */
static Status refuse(Instance *instance, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    write_message(instance, instance->call->refusal, format, arguments);
    va_end(arguments);
    if (instance->call->refusal == STATUS_ERROR) instance->state = TERMINATED;
    return instance->call->refusal;
}

bool instance_admits(Instance *instance, const Call *call) {
    instance->call = call;
    if (instance->state & call->states) return true;
    instance_error(instance, "must not be called in this state");
    return false;
}

static void evaluate(Instance *instance) {
    if (instance->current) return;
    for (size_t i = 0; i < ARGUMENT_COUNT; i++) instance->arg[i] = &instance->values[places[i]];
    for (size_t i = 0; i < RESULT_COUNT; i++) instance->res[i] = &instance->values[places[ARGUMENT_COUNT + i]];
    FUNCTION(instance->arg, instance->res, instance->iw, instance->w, 0);
    instance->current = true;
}

Status instance_get(Instance *instance, const unsigned references[], size_t count, double values[]) {
    if (count > 0 && !(references && values)) return instance_error(instance, "an array is NULL");
    for (size_t i = 0; i < count; i++) {
        if (references[i] >= VARIABLE_COUNT)
            return instance_error(instance, "value reference %u is unknown", references[i]);
        if (references[i] >= FIRST_OUTPUT) evaluate(instance);
        if (!isfinite(instance->values[references[i]]))
            return refuse(instance, "%s leaves the range of finite numbers", names[references[i]]);
    }
    for (size_t i = 0; i < count; i++) values[i] = instance->values[references[i]];
    return STATUS_OK;
}

Status instance_set(Instance *instance, const unsigned references[], size_t count, const double values[]) {
    if (count > 0 && !(references && values)) return instance_error(instance, "an array is NULL");
    for (size_t i = 0; i < count; i++) {
        if (references[i] < 1 || references[i] >= FIRST_OUTPUT)
            return instance_error(instance, "value reference %u is no input", references[i]);
        if (!isfinite(values[i]))
            return refuse(instance, "%s = %.10g: must be finite", names[references[i]], values[i]);
    }
    for (size_t i = 0; i < count; i++) instance->values[references[i]] = values[i];
    instance->current = false;
    return STATUS_OK;
}

Status instance_start(Instance *instance, double time) {
    if (!isfinite(time)) return instance_error(instance, "startTime = %.10g s: must be finite", time);
    instance->values[0] = time;
    return STATUS_OK;
}

Status instance_step(Instance *instance, double time, double h) {
    if (!(h > 0.0 && isfinite(time + h)))
        return refuse(instance, "step from %.10g s by %.10g s: must be finite and > 0", time, h);
    instance->values[0] = time + h;
    return STATUS_OK;
}
