/* An instance of a function without memory, outputs = f(inputs), as a co-simulation FMU.

   function.h, generated, gives the function, its sizes, start values and token. Values by reference: time,
   inputs, outputs. The functions that no such FMU supports are those of fmu_build/c/fmi*_unsupported.c, which
   include this file in place of their own instance.h. */
#ifndef INSTANCE_H
#define INSTANCE_H

#include <stdbool.h>
#include <stddef.h>

#include "function.h"

enum { FIRST_OUTPUT = 1 + INPUT_COUNT, VARIABLE_COUNT = 1 + INPUT_COUNT + OUTPUT_COUNT };

/* In the order of fmi2Status and fmi3Status. */
typedef enum { STATUS_OK, STATUS_WARNING, STATUS_DISCARD, STATUS_ERROR } Status;

/* Where in its life cycle an instance is, as bits. */
typedef enum { INSTANTIATED = 1, INITIALIZATION = 2, STEPPING = 4, TERMINATED = 8, ANY_STATE = 15 } State;

/* An FMI function, the states it may be called in, and what it answers to values that cannot be used. */
typedef struct {
    const char *name;
    unsigned states;
    Status refusal;
} Call;

typedef struct Instance Instance;
struct Instance {
    double values[VARIABLE_COUNT];
    bool current; /* the outputs follow from the inputs */
    bool logging;
    unsigned state;
    const Call *call;
    void *environment;            /* the importer's, as is the callback */
    void (*log_callback)(void);
    void (*write_log)(const Instance *instance, Status status, const char *category, const char *message);
    const double *arg[WORK_ARG];
    double *res[WORK_RES];
    int iw[WORK_INT];
    double w[WORK_REAL];
    char name[]; /* the importer's name of the instance */
};

/* Returns a new instance with the start values, or NULL if it has no name, the token is another's or there is no
   memory. */
Instance *instance_new(const char *name, const char *token);
void instance_reset(Instance *instance);

/* Whether the call may be answered in the instance's state; if not, the instance is TERMINATED and a line logged. */
bool instance_admits(Instance *instance, const Call *call);

/* Logs that the importer broke a rule, terminates the instance and returns STATUS_ERROR. */
Status instance_error(Instance *instance, const char *format, ...);

/* Gets or sets values by reference, all of them or none. Outputs follow the inputs at once. */
Status instance_get(Instance *instance, const unsigned references[], size_t count, double values[]);
Status instance_set(Instance *instance, const unsigned references[], size_t count, const double values[]);

/* Sets the time [s]; goes on from it by h [s]. */
Status instance_start(Instance *instance, double time);
Status instance_step(Instance *instance, double time, double h);

#endif
