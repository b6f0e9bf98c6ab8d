/* An instance of the model: its life cycle, its log, its values.

   An instance is one block of memory, owned by the importer between instance_new and instance_free. Functions
   return STATUS_OK, or log one line and return what the FMI function shall return; after STATUS_DISCARD the
   instance is as it was before the call, after STATUS_ERROR it is TERMINATED. */
#ifndef INSTANCE_H
#define INSTANCE_H

#include <fenv.h>
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

/* Where in its life cycle an instance is, as bits: a call is allowed in some of them, and in one interface if it says
   so. */
typedef enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    STEPPING = 4,        /* co-simulation, between steps */
    INTERMEDIATE = 8,    /* co-simulation, in the importer's callback within a step */
    EVENT = 16,          /* model exchange; co-simulation whose importer uses event mode */
    CONTINUOUS = 32,     /* model exchange */
    TERMINATED = 64,
    BEFORE_START = INSTANTIATED | INITIALIZATION,
    RUNNING = STEPPING | EVENT | CONTINUOUS,
    ANY_STATE = 127,
    ONLY_CO_SIMULATION = 128,
    ONLY_MODEL_EXCHANGE = 256
} State;

/* Log categories, as bits. */
typedef enum { LOG_DISCARD = 1, LOG_ERROR = 2, LOG_COMPOSITE = 4, LOG_ALL = 7 } LogCategory;

/* An FMI function: the states it may be called in, and what it answers to values that cannot be used. */
typedef struct {
    const char *name;
    unsigned states;
    Status refusal;
} Call;

/* Of a text that instance_print writes. */
enum { PRINT_SIZE = 4 * 202 + 1 };

typedef struct Instance Instance;

/* Hands a message on to the importer in its version of FMI. */
typedef void (*LogWriter)(const Instance *instance, Status status, const char *category, const char *message);

/* Tells the importer that a sub-step ended, in its version of FMI. Returns whether it wants the step to end
   early, at *end [s] or as soon as possible after it. */
typedef bool (*SubStepListener)(Instance *instance, double *end);

/* How a step goes on that is counted from an epoch: by free_motion, as the first one did, or by free_at. The first of
   them finds out which; an epoch that no step goes on from, as where torque acts again, costs nothing more. */
typedef enum { EPOCH_NEW, EPOCH_SERVED, EPOCH_DOUBLED } EpochStep;

/* All that a saved state holds. The doubles come first: there is no padding but at the end, and that stays zero. */
typedef struct {
    double values[VARIABLE_COUNT];    /* by value reference: time, inputs, parameters, outputs, states, rates */
    double start_time;                /* s */
    double stop_time;                 /* s, meaningful if stop_time_defined */
    double tolerance;                 /* the importer's or the scene's */
    double error_estimate;            /* rad, of the last communication step */
#if STATE_IS_MOMENTUM
    double x[STATE_COUNT];            /* attitude and angular velocity; the states hold the momentum */
    double kept_momentum[3];          /* N.m.s, of the states when changes were committed last */
#endif
#if CHANGES
    double kept_rate[3];              /* rad/s, that a change of inputs began from, with stepped_p */
    double kept_c[COMPOSITE_COUNT];   /* the composite of stepped_p */
#endif
    double p[INPUT_P_COUNT + 1];      /* the composite's inputs, directions scaled; + 1: may be none */
    double c[COMPOSITE_COUNT];        /* the composite of p */
    double a[AXES_COUNT + 1];         /* moments, axes and the like of c */
    double stepped_p[INPUT_P_COUNT + 1]; /* p of the last communication step or event, at first of the start */
    double epoch[STATE_COUNT];        /* the state that free motion is counted from */
    double elapsed, elapsed_rest;     /* s since then, as an unevaluated sum */
#if FREE == FREE_ALWAYS || FREE == FREE_WHILE_FREE
    double from_epoch[FREE_START];    /* what free_at needs of the epoch, if epoch_step is EPOCH_SERVED */
#endif
    unsigned state;                   /* a State */
    unsigned model_exchange;          /* else co-simulation */
#if CHANGES
    unsigned ended_in;                /* the State before TERMINATED */
#endif
    unsigned stop_time_defined;
    unsigned composite_is_current;    /* p and c follow from the inputs as they are */
    unsigned composite_is_ordinary;   /* products of a few numbers of p and c are doubles */
    unsigned axes_are_current;        /* a follows from c */
    unsigned epoch_holds;             /* the motion has been free since epoch, with stepped_p */
#if FREE == FREE_ALWAYS || FREE == FREE_WHILE_FREE
    unsigned epoch_step;              /* an EpochStep */
#endif
} Dynamics;

/* Small changes of, or weights on, what the model's functions take and give. */
typedef struct {
    double inputs[INPUT_P_COUNT + INPUT_K_COUNT + INPUT_U_COUNT + 1]; /* + 1: there may be none; motion at contact */
                                                                      /* changes nothing between events */
    double x[STATE_COUNT], c[COMPOSITE_COUNT];
    double rate[STATE_COUNT], y[OUTPUT_COUNT + 1];
} Variation;

struct Instance {
    Dynamics now;
    bool outputs_are_current;         /* the outputs in now.values follow from states, inputs and now.c */
    bool rates_are_current;           /* so do the rates */
#if STATE_IS_MOMENTUM
    bool mirror_is_current;           /* x and the states agree */
#endif
    Variation variation;
    const double *arg[WORK_ARG];
    double *res[WORK_RES];
    int iw[WORK_INT];
    double w[WORK_REAL];

    const Call *call;                 /* the FMI function being answered */
    void *environment;                /* the importer's, handed back with each callback */
    LogWriter write_log;
    void (*log_callback)(void);       /* the importer's, of the type that write_log knows */
    SubStepListener sub_step_ended;   /* NULL: nobody listens */
    void (*sub_step_callback)(void);  /* the importer's, of the type that sub_step_ended knows */
    bool early_return_allowed;
    bool within_step;                 /* in the importer's callback: most calls have to wait */
    bool event_mode_used;             /* in co-simulation */
    unsigned log_categories;
    char name[PRINT_SIZE];            /* the importer's name of the instance, as it is printed */
};

/* Writes a text of the importer's as it may be printed: 200 bytes of it at most, what is no character to be shown, and
   the percent sign, as \xNN for each of its bytes. */
void instance_print(const char *text, char shown[PRINT_SIZE]);

/* Returns a new instance in state INSTANTIATED with the scene's start values, or NULL if there is no memory. */
Instance *instance_new(const char *name, bool model_exchange);
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

/* Where the FMU's states (attitude w, x, y, z; angular velocity, rad/s, or momentum, N.m.s) and their rates stand among
   the values. */
static inline double *instance_states(Instance *instance) {
    return &instance->now.values[REFERENCE_STATES];
}
static inline double *instance_rates(Instance *instance) {
    return &instance->now.values[REFERENCE_DERIVATIVES];
}

/* Attitude and angular velocity. */
static inline double *instance_x(Instance *instance) {
#if STATE_IS_MOMENTUM
    return instance->now.x;
#else
    return instance_states(instance);
#endif
}

/* Ends the instance. */
static inline void instance_terminate(Instance *instance) {
#if CHANGES
    if (instance->now.state != TERMINATED) instance->now.ended_in = instance->now.state;
#endif
    instance->now.state = TERMINATED;
}

/* What follows from attitude, angular velocity or states has to be computed anew. */
static inline void instance_state_moved(Instance *instance) {
    instance->outputs_are_current = instance->rates_are_current = false;
#if STATE_IS_MOMENTUM
    instance->mirror_is_current = false;
#endif
}

/* Points the first arguments of the model's functions to x, u, c, a, and the estimate. Of ode and response the first
   one is the states instead. */
static inline void instance_set_arguments(Instance *instance) {
    instance->arg[0] = instance_x(instance);
    instance->arg[1] = &instance->now.values[REFERENCE_TORQUE];
    instance->arg[2] = instance->now.c;
    instance->arg[3] = instance->now.a;
    instance->arg[4] = &instance->now.error_estimate;
}
static inline void instance_set_state_arguments(Instance *instance) {
    instance_set_arguments(instance);
#if STATE_IS_MOMENTUM
    instance->arg[0] = instance_states(instance);
#endif
}

/* Whether products of a few of these numbers are doubles. */
bool are_ordinary(const double numbers[], size_t count);

/* Whether all that follows from states, inputs and composite surely is within the range of doubles. */
bool instance_is_ordinary(Instance *instance);

typedef int ModelFunction(const double **arg, double **res, int *iw, double *w, int mem);

/* Calls one of the model's functions. It gives results together: where they are not surely within the range of doubles,
   one that nobody has asked for may overflow, and those asked for are judged one by one afterwards. An importer that
   traps overflow must not die of the others, and no flag of its own may change. */
static inline void instance_call(Instance *instance, ModelFunction *function, bool ordinary) {
    fenv_t importers;
    if (!ordinary) feholdexcept(&importers);
    function(instance->arg, instance->res, instance->iw, instance->w, 0);
    if (!ordinary) fesetenv(&importers);
}

/* Sets the time to start at and, if defined, the time not to be passed [s] and the importer's own tolerance. */
Status instance_set_experiment(Instance *instance, bool tolerance_defined, double tolerance, double start_time,
                               bool stop_time_defined, double stop_time);

/* Judges what was set, fixes the state at the start and goes on to STEPPING or EVENT. */
Status instance_exit_initialization(Instance *instance);

/* Takes the states at the start from the parameters, the attitude at length 1. */
Status instance_start_attitude(Instance *instance);
void instance_start_rate(Instance *instance);

/* variables.c: gets or sets values by value reference, all of them or none. */
Status instance_get(Instance *instance, const unsigned references[], size_t count, double values[]);
Status instance_set(Instance *instance, const unsigned references[], size_t count, const double values[]);
Status instance_check_references(Instance *instance, const unsigned references[], size_t count);

/* variables.c, where the scene has Booleans, all of them inputs: whether these references are such, and whether one
   may be set to a value now: outside event mode it must keep the one it has. Then get and set cannot fail. */
Status instance_check_booleans(Instance *instance, const unsigned references[], size_t count, const void *values);
Status instance_check_boolean(Instance *instance, unsigned reference, bool value);
bool instance_get_boolean(const Instance *instance, unsigned reference);
void instance_set_boolean(Instance *instance, unsigned reference, bool value);

/* Whether the state has an attitude that can be brought to unit length; a solver may have lost it. */
Status instance_check_attitude(Instance *instance);

/* continuous states of model exchange, in the order of the table */
Status instance_set_time(Instance *instance, double time);
Status instance_get_states(Instance *instance, double states[], size_t count);
Status instance_set_states(Instance *instance, const double states[], size_t count);
Status instance_get_rates(Instance *instance, double rates[], size_t count);
Status instance_get_nominals(Instance *instance, double nominals[], size_t count);

/* composite.c: makes c follow from the inputs, unless it does: judges them and computes the composite. */
Status composite_refresh(Instance *instance);

#if CHANGES
/* Computes and judges the composite c of inputs p on the way of a change. */
Status composite_between(Instance *instance, const double p[], double c[]);
#endif

/* Makes a follow from c, unless it does. */
void composite_refresh_axes(Instance *instance);

/* Multiplies a change of p, or weights on p as scaled, by the powers of two that the directions were scaled by. */
void composite_scale_variation(const Instance *instance, double p[]);

/* solver.c: advances the state from time [s] by one communication step of size h [s], or to where the importer
   wants it to end early. */
Status solver_step(Instance *instance, double time, double h, bool *ended_early);

/* free.c: whether motion without torque from a state over a time [s] turns little enough to be followed. */
bool free_reaches(const double x[], double time);

/* Carries a state on by a time [s] of motion without torque. */
Status free_motion(Instance *instance, const double x[], double time, double next[]);

#if FREE == FREE_ALWAYS || FREE == FREE_WHILE_FREE
/* The same from now.epoch, at a small cost from its second time on. */
Status free_motion_from_epoch(Instance *instance, double time, double next[]);
#endif

/* derivatives.c: partial derivatives of outputs and rates by inputs and states, at what the outputs are now;
   in INITIALIZATION of outputs, states and rates by inputs and parameters. Forward: sensitivity of unknowns to a
   change (seed) of knowns. Adjoint: of the seed-weighted sum of unknowns to each known. */
Status derivatives_forward(Instance *instance, const unsigned unknowns[], size_t unknown_count,
                           const unsigned knowns[], size_t known_count, const double seed[], double sensitivity[]);
Status derivatives_adjoint(Instance *instance, const unsigned unknowns[], size_t unknown_count,
                           const unsigned knowns[], size_t known_count, const double seed[], double sensitivity[]);

/* Derivatives of outputs with respect to time, inputs held; orders must be 1. */
Status derivatives_of_time(Instance *instance, const unsigned references[], size_t count, const int orders[],
                           double values[]);

/* saved_state.c: copies of Dynamics, owned by the importer between save and free. */
Status saved_state_save(Instance *instance, void **saved);
Status saved_state_restore(Instance *instance, const void *saved);
Status saved_state_free(Instance *instance, void **saved);
Status saved_state_size(Instance *instance, const void *saved, size_t *size);
Status saved_state_serialize(Instance *instance, const void *saved, unsigned char bytes[], size_t size);
Status saved_state_deserialize(Instance *instance, const unsigned char bytes[], size_t size, void **saved);

#endif
