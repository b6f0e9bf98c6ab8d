/* An instance of the model: its life cycle, its log, its values.

   An instance is one block of memory, owned by the importer between instance_new and instance_free. Functions
   return STATUS_OK, or log one line and return what the FMI function shall return; after STATUS_DISCARD the
   instance is as it was before the call, after STATUS_ERROR it is TERMINATED. */
#ifndef INSTANCE_H
#define INSTANCE_H

#include <stdbool.h>
#include <stddef.h>

#include "variables.h"

#if defined(__GNUC__)
#define PRINTF_LIKE(text, values) __attribute__((format(printf, text, values)))
#else
#define PRINTF_LIKE(text, values)
#endif

/* In the order of fmi2Status and fmi3Status. */
typedef enum { STATUS_OK, STATUS_WARNING, STATUS_DISCARD, STATUS_ERROR, STATUS_FATAL } Status;

typedef enum { INSTANTIATED = 1, INITIALIZATION = 2, STEPPING = 4, TERMINATED = 8 } State;

/* Log categories, as bits. */
typedef enum { LOG_DISCARD = 1, LOG_ERROR = 2, LOG_COMPOSITE = 4, LOG_ALL = 7 } LogCategory;

/* An FMI function: the states it may be called in, and what it answers to values that cannot be used. */
typedef struct {
    const char *name;
    unsigned states;
    Status refusal;
} Call;

typedef struct Instance Instance;

/* Hands a message on to the importer in its version of FMI. */
typedef void (*LogWriter)(const Instance *instance, Status status, const char *category, const char *message);

struct Instance {
    State state;
    const Call *call;                 /* the FMI function being answered */
    LogWriter write_log;
    void *environment;                /* the importer's, handed back with each message */
    void (*log_callback)(void);       /* the importer's, of the type that write_log knows */
    unsigned log_categories;

    double time;                      /* s */
    double stop_time;                 /* s, meaningful if stop_time_defined */
    bool stop_time_defined;

    bool composite_is_current;        /* c follows from the inputs as they are */
    bool outputs_are_current;         /* values of outputs follow from x, the inputs and c */
    double values[VARIABLE_COUNT];    /* by value reference */
    double p[INPUT_P_COUNT + 1];      /* the composite's inputs, directions scaled; + 1: may be none */
    double c[COMPOSITE_COUNT];
    double x[STATE_COUNT];            /* attitude w, x, y, z; angular velocity, rad/s */
    const double *arg[WORK_ARG];
    double *res[WORK_RES];
    int iw[WORK_INT];
    double w[WORK_REAL];
    char name[];                      /* the importer's name of the instance */
};

/* Returns a new instance in state INSTANTIATED with the scene's start values, or NULL if there is no memory. */
Instance *instance_new(const char *name);
void instance_free(Instance *instance);

/* Back to what instance_new made; the log settings stay. */
void instance_reset(Instance *instance);

/* Whether the call may be answered in the instance's state; if not, the instance is TERMINATED and a line logged.
   Messages of what follows begin with the call's name. */
bool instance_admits(Instance *instance, const Call *call);

/* Logs that the importer broke a rule, terminates the instance and returns STATUS_ERROR. */
Status instance_error(Instance *instance, const char *format, ...) PRINTF_LIKE(2, 3);

/* Logs that a value cannot be used and returns the call's refusal; terminates the instance if that is an error. */
Status instance_refuse(Instance *instance, const char *format, ...) PRINTF_LIKE(2, 3);

/* Logs for information, if the category is on. */
void instance_inform(Instance *instance, LogCategory category, const char *format, ...) PRINTF_LIKE(3, 4);

/* Turns categories on by name (count 0: all of them) or, with on == false, everything off. */
Status instance_set_logging(Instance *instance, bool on, size_t count, const char *const names[]);

/* Sets the time to start at and, if defined, the time not to be passed [s]. */
Status instance_set_times(Instance *instance, double start_time, bool stop_time_defined, double stop_time);

/* Judges what was set, fixes the state at the start and goes on to STEPPING. */
Status instance_exit_initialization(Instance *instance);

/* Gets or sets values by value reference: all of them or none. */
Status instance_get(Instance *instance, const unsigned references[], size_t count, double values[]);
Status instance_set(Instance *instance, const unsigned references[], size_t count, const double values[]);

/* Takes the state at the start from the parameters, the attitude at length 1. */
Status instance_start_state(Instance *instance);

/* Makes c follow from the inputs, unless it does: judges them and computes the composite. */
Status composite_refresh(Instance *instance);

/* Advances the state by one communication step of size h [s] from time [s]. */
Status solver_step(Instance *instance, double time, double h);

#endif
