/* The life cycle of an instance and its log: made, reset, judged by the state that a call may come in, set going.

   Owns the instance's memory and all that is not in Dynamics; of that the state, the times, the tolerance, and the
   states as the start parameters make them. */
#include "instance.h"

#include <float.h>
#include <locale.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "actions.h"
#include "changes.h"
#include "error_bound.h"
#include "field.h"
#include "variables.h"

enum { MESSAGE_SIZE = 1024, LONGEST_NAME = 200 };

static const struct {
    const char *name;
    unsigned categories;
} LOG_CATEGORIES[] = {
    {LOG_NAME_DISCARD, LOG_DISCARD},
    {LOG_NAME_ERROR, LOG_ERROR},
    {LOG_NAME_COMPOSITE, LOG_COMPOSITE},
    {LOG_NAME_TOLERANCE, LOG_TOLERANCE},
#if ACCURACY_ASKED
    {LOG_NAME_ACCURACY, LOG_ACCURACY},
#endif
    {LOG_NAME_ALL, LOG_ALL},
};

static const size_t LOG_CATEGORY_COUNT = sizeof LOG_CATEGORIES / sizeof LOG_CATEGORIES[0];

/* How many bytes at the beginning of a text, in UTF-8, are no character to be shown: controls, separators of lines, marks
   that turn the direction of writing, and the percent sign, since a logger of FMI 2 takes messages for formats. */
static size_t not_shown(const char *text) {
    const unsigned char *c = (const unsigned char *)text;
    if (c[0] < 0x20 || c[0] == 0x7F || c[0] == '%') return 1;
    if ((c[0] == 0xC2 && c[1] >= 0x80 && c[1] <= 0x9F) || (c[0] == 0xD8 && c[1] == 0x9C)) return 2;
    if (c[0] != 0xE2 || (c[1] != 0x80 && c[1] != 0x81)) return 0;
    const bool mark = c[2] == 0x8E || c[2] == 0x8F || (c[2] >= 0xA8 && c[2] <= 0xAE);
    const bool isolate = c[2] >= 0xA6 && c[2] <= 0xA9;
    return (c[1] == 0x80 ? mark : isolate) ? 3 : 0;
}

void instance_print(const char *text, char shown[PRINT_SIZE]) {
    size_t read = 0, written = 0;
    while (text[read] && read < LONGEST_NAME) {
        const size_t escaped = not_shown(text + read);
        for (size_t i = 0; i < escaped; i++)
            written += (size_t)snprintf(shown + written, PRINT_SIZE - written, "\\x%02x", (unsigned char)text[read++]);
        if (escaped == 0) shown[written++] = text[read++];
    }
    while (text[read] && written > 0 && (text[read] & 0xC0) == 0x80) { /* no part of a character */
        read--;
        written--;
    }
    shown[written] = '\0';
}

Instance *instance_new(const char *name, bool model_exchange) {
    Instance *instance = calloc(1, sizeof *instance);
    if (!instance) return NULL;
    instance_print(name, instance->name);
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
    instance->told = false;
    instance_state_moved(instance);
    instance->now.tolerance = TOLERANCE;
    for (size_t i = 0; i < VARIABLE_COUNT; i++) instance->now.values[i] = VARIABLES[i].start;
    instance_start_rate(instance);
    instance_start_attitude(instance);
    bound_start(instance);
}

static bool is_digit(char c) {
    return c >= '0' && c <= '9';
}

/* Puts points into numbers, in place of the mark that the host's locale has there: "(1,5, 2)" could be three numbers.
   In brackets are indices, which have commas of their own. */
static void put_points(char *message) {
    const char *mark = localeconv()->decimal_point;
    const size_t length = strlen(mark);
    bool index = false;
    size_t written = 0;
    for (size_t read = 0; message[read];) {
        index = message[read] == '[' || (index && message[read] != ']');
        const bool point = !index && length > 0 && read > 0 && is_digit(message[read - 1]) &&
                           strncmp(message + read, mark, length) == 0 && is_digit(message[read + length]);
        message[written++] = point ? '.' : message[read];
        read += point ? length : 1;
    }
    message[written] = '\0';
}

static void write_message(Instance *instance, Status status, LogCategory category, const char *format,
                          va_list arguments) {
    if (!(instance->log_categories & (unsigned)category)) return;
    char message[MESSAGE_SIZE];
    const int prefix = snprintf(message, sizeof message, "%s: ", instance->call->name);
    vsnprintf(message + prefix, sizeof message - (size_t)prefix, format, arguments);
    put_points(message);
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
    return status;
}

Status instance_refuse_size(Instance *instance, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    write_message(instance, STATUS_DISCARD, LOG_DISCARD, format, arguments);
    va_end(arguments);
    return STATUS_DISCARD;
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
    unsigned categories = count == 0 ? LOG_ALL : 0;
    for (size_t i = 0; i < count; i++) {
        size_t k = 0;
        while (k < LOG_CATEGORY_COUNT && !(names[i] && strcmp(names[i], LOG_CATEGORIES[k].name) == 0)) k++;
        if (k == LOG_CATEGORY_COUNT)
            return instance_error(instance, "category %zu is not one of the model description's", i + 1);
        categories |= LOG_CATEGORIES[k].categories;
    }
    if (on)
        instance->log_categories |= categories;
    else
        instance->log_categories &= ~categories;
    return STATUS_OK;
}

/* The tolerance nearest to the importer's that steps can keep to; an importer's own is often 0, or made for another
   FMU, and the standard lets an FMU for co-simulation ignore it (FMI 2.0: 2.1.6, FMI 3.0: 2.3.2). */
static double possible_tolerance(Instance *instance, double tolerance) {
    const double possible = fmin(fmax(tolerance, LEAST_TOLERANCE), LARGEST_TOLERANCE);
    if (possible != tolerance)
        instance_inform(instance, LOG_TOLERANCE, "tolerance = %.10g: %g is taken, since steps keep to %g to %g",
                        tolerance, possible, LEAST_TOLERANCE, LARGEST_TOLERANCE);
    return possible;
}

Status instance_set_experiment(Instance *instance, bool tolerance_defined, double tolerance, double start_time,
                               bool stop_time_defined, double stop_time) {
    if (!isfinite(start_time)) return instance_error(instance, "startTime = %.10g s: must be finite", start_time);
    if (stop_time_defined && !(stop_time >= start_time))
        return instance_error(instance, "stopTime = %.10g s: must not be before startTime = %.10g s", stop_time,
                              start_time);
    tolerance_defined = tolerance_defined && ERROR_CONTROLLED && !instance->now.model_exchange;
    if (tolerance_defined && !(isfinite(tolerance) && tolerance >= 0.0))
        return instance_error(instance, "tolerance = %.10g: must be finite and >= 0", tolerance);
    instance->now.tolerance = tolerance_defined ? possible_tolerance(instance, tolerance) : TOLERANCE;
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
    const double near = largest <= 2.0 ? 1.0 : 0.0, q[4] = {near * attitude[0], near * attitude[1], near * attitude[2],
                                                            near * attitude[3]};
    const bool is_unit = fabs((q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]) - 1.0) <= 4.0 * DBL_EPSILON;
    double *x = instance_x(instance);
    for (size_t i = 0; i < 4; i++) x[i] = is_unit ? attitude[i] : attitude[i] / largest / sqrt(square);
    instance_state_moved(instance);
    return STATUS_OK;
}

void instance_start_rate(Instance *instance) {
    double *x = instance_x(instance);
    memcpy(x + 4, &instance->now.values[REFERENCE_RATE_START], 3 * sizeof(double));
    memcpy(x + 7, &instance->now.values[REFERENCE_ATTITUDE_START + 4], (STATE_COUNT - 7) * sizeof(double));
    instance_state_moved(instance);
}

/* Judges the momenta of wheels at the start; their parameters follow those of the attitude. */
static Status check_momenta(Instance *instance) {
    for (size_t i = 7; i < STATE_COUNT; i++) {
        const double momentum = instance_x(instance)[i];
        if (fabs(momentum) <= LARGEST_MOMENTUM) continue;
        return instance_refuse(instance, "%s = %.10g N.m.s: must be at most %g either way",
                               VARIABLES[REFERENCE_ATTITUDE_START + 4 + (i - 7)].name, momentum, LARGEST_MOMENTUM);
    }
    return STATUS_OK;
}

Status instance_exit_initialization(Instance *instance) {
    instance_start_rate(instance);
    Status status = instance_start_attitude(instance);
    if (status == STATUS_OK) status = check_momenta(instance);
    if (status == STATUS_OK) status = composite_refresh(instance);
    if (status == STATUS_OK) status = field_check(instance);
    if (status == STATUS_OK) status = actions_check(instance);
    if (status != STATUS_OK) return status;
    changes_start(instance);
    bound_start(instance);
    instance->now.state = instance->now.model_exchange ? EVENT : STEPPING;
    /* where the states lead now, the rate follows from them as it will ever after */
    if (STATE_IS_MOMENTUM) instance_state_moved(instance);
    return STATUS_OK;
}
