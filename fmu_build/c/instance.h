/* An instance of the model: its memory, its life cycle, its log.

   An instance is one block of memory, owned by the importer between instance_new and instance_free; nothing else is
   allocated but saved states. Functions return STATUS_OK, or log one line and return what the FMI function shall
   return. After a value that cannot be used (instance_refuse), or a step that is too long, the instance is as it was
   before the call; after a broken rule (instance_error) it is TERMINATED.

   A mass on its way from the importer's set to a get, copy by copy; beside each arrow stands the file that owns the
   copy which the arrow points to: it alone writes there.

       importer: SetFloat64
          |
          |  variables.c
          v
       now.values[its reference]         as it was set, judged by nobody yet; a get of the input reads this
          |
          |  composite.c                 at the first use: a step, an event, a get of what follows from it
          v
       scratch.candidate.p --> .c        judged; the composite of it computed; gone when the call ends
          |
          |  changes.c                   if all can be used: the rate changes with it, or the momentum
          v
       now.p --> now.c --> now.a         what everything after it reads (a: composite.c, once it is asked for)
          |         |
          |         |  variables.c       outputs of state, torque, c and a
          |         v
          |      now.values[outputs] --> importer: GetFloat64
          |
          |  solver.c, at the end of a step; changes.c, at the end of an event
          v
       now.stepped_p                     what the next change begins from (its composite: now.kept_c, changes.c)

   A saved state is a copy of `now`, owned by the importer: saved_state.c. */
#ifndef INSTANCE_H
#define INSTANCE_H

#include <fenv.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "scene.h"

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
typedef enum {
    LOG_DISCARD = 1,
    LOG_ERROR = 2,
    LOG_COMPOSITE = 4,
    LOG_TOLERANCE = 8,
    LOG_ACCURACY = 16,
    LOG_ALL = 31
} LogCategory;

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

/* How steps after the first one are computed that are counted from the same epoch: by free_motion, as the first one
   was (EPOCH_DOUBLED), or by free_at, from theta functions (EPOCH_SERVED). The second step decides (EPOCH_NEW until
   then): a free step that stands alone costs nothing more. */
typedef enum { EPOCH_NEW, EPOCH_SERVED, EPOCH_DOUBLED } EpochStep;

/* The angular velocity and, behind it, the momenta of wheels: all that of x is not the attitude. */
enum { RATE_COUNT = STATE_COUNT - 4 };

/* Places in errors. */
enum { ESTIMATE, BOUND };

#if HANDED_COUNT
/* What an instant of change hands over, see hand_over.h: jumps [m, m/s], then outputs of vessels that leave. */
typedef struct {
    double values[HANDED_COUNT];
    double time; /* s: of the instant */
} Handed;
#endif

/* All that a saved state holds. The doubles come first: there is no padding but at the end, and that stays zero. Arrays
   that a scene does not need have one element, which stays zero too. */
typedef struct {
    double values[VARIABLE_COUNT];    /* by value reference: time, inputs, parameters, outputs, states, rates */
    double start_time;                /* s */
    double stop_time;                 /* s, meaningful if stop_time_defined */
    double tolerance;                 /* the importer's or the scene's */
    double errors[2];                 /* rad: the estimate of the last communication step; the bound since the start */
    double bound[ERROR_BOUND ? 3 + FIELD : 1]; /* of the angle, rad; of the rate in the energy norm, J^(1/2); of the rate,
                                                  rad/s; of the place in a field of gravity, over the distance */
    struct {
        double rate[ERROR_BOUND ? 3 : 1], c[ERROR_BOUND ? COMPOSITE_COUNT : 1], p[ERROR_BOUND ? INPUT_P_COUNT + 1 : 1];
    } bound_from;                     /* rate, composite and inputs that the bound's next change begins from */
    double x[STATE_IS_MOMENTUM ? STATE_COUNT : 1]; /* as of instance_x; the states hold the momentum of the whole */
    double kept_momentum[STATE_IS_MOMENTUM ? 3 : 1]; /* N.m.s, of the states when changes were committed last */
    double kept_rate[CHANGES ? RATE_COUNT : 1]; /* rad/s, N.m.s: that a change of inputs began from, with stepped_p */
    double kept_c[CHANGES ? COMPOSITE_COUNT : 1]; /* the composite of stepped_p */
    double p[INPUT_P_COUNT + 1];      /* the composite's inputs, directions scaled; + 1: may be none */
    double c[COMPOSITE_COUNT];        /* the composite of p */
    double a[AXES_COUNT + 1];         /* moments, axes and the like of c */
    double stepped_p[INPUT_P_COUNT + 1]; /* p of the last communication step or event, at first of the start */
#if HANDED_COUNT
    struct { Handed latest, committed; } handed; /* with the inputs as they are; as changes were committed last */
#endif
    double epoch[STATE_COUNT];        /* the state that free motion is counted from */
    double elapsed, elapsed_rest;     /* s since then, as an unevaluated sum */
    double from_epoch[FREE_START];    /* what free_at needs of the epoch, if epoch_step is EPOCH_SERVED */
#if FIELD
    double place[6];                  /* m, m/s: where the last communication step has brought the centre */
    unsigned place_holds;             /* the centre is there: no place has been set since */
#endif
    unsigned state;                   /* a State */
    unsigned model_exchange;          /* else co-simulation */
    unsigned ended_in;                /* the State before TERMINATED */
    unsigned stop_time_defined;
    unsigned composite_is_current;    /* p and c follow from the inputs as they are */
    unsigned composite_is_ordinary;   /* products of a few numbers of p and c are doubles */
    unsigned constants_are_tame;      /* c and a are of no size that the bound of the error has to be careful with */
    unsigned axes_are_current;        /* a follows from c */
    unsigned epoch_holds;             /* the motion has been free since epoch, with stepped_p */
    unsigned epoch_step;              /* an EpochStep */
} Dynamics;

/* Small changes of, or weights on, what the model's functions take and give: see derivatives.c. */
typedef struct {
    double inputs[INPUT_P_COUNT + INPUT_K_COUNT + INPUT_U_COUNT + 1]; /* + 1: there may be none */
    double x[STATE_COUNT], c[COMPOSITE_COUNT];
    double rate[STATE_COUNT], y[OUTPUT_COUNT + 1];
} Variation;

/* Inputs that are judged, directions scaled, and the composite of them: see composite_refresh. */
typedef struct {
    double p[INPUT_P_COUNT + 1], c[COMPOSITE_COUNT];
} Candidate;

struct Instance {
    Dynamics now;
    bool outputs_are_current;         /* the outputs in now.values follow from states, inputs and now.c */
    bool rates_are_current;           /* so do the rates */
    bool mirror_is_current;           /* x and the states agree, where these hold the momentum */
    union {
        Candidate candidate;
        Variation variation;
    } scratch;                        /* nothing in it outlasts a call; making the composite current takes the */
                                      /* candidate, so that comes before anything is laid into the variation */
    const double *arg[WORK_ARG];
    double *res[WORK_RES];
    int iw[WORK_INT];
    double w[WORK_REAL];
#if FIELD
    double acting[INPUT_U_COUNT];     /* the inputs u with a place that has moved, see field.h */
    double moved[6];                  /* m, m/s: where a sub-step ends, before it is taken */
    double left[6];                   /* where the last one began */
    bool moves;                       /* the model is given `acting` */
#endif

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
    bool told;                        /* that the bound of the error has passed what the scene asks for */
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

/* Logs that a value cannot be used and returns the call's refusal; the instance is as it was before the call, whatever
   the status is: with a good value the same call works. */
Status instance_refuse(Instance *instance, const char *format, ...) PRINTF_LIKE(2, 3);

/* Logs that a step is too long and returns STATUS_DISCARD, in either version of FMI: a shorter one may do. */
Status instance_refuse_size(Instance *instance, const char *format, ...) PRINTF_LIKE(2, 3);

/* Logs for information, if the category is on. */
void instance_inform(Instance *instance, LogCategory category, const char *format, ...) PRINTF_LIKE(3, 4);

/* Turns the named categories on, or with on == false off, and leaves the others as they are; count 0: all of them. An
   unknown name is an error, and nothing is changed. */
Status instance_set_logging(Instance *instance, bool on, size_t count, const char *const names[]);

/* Where the FMU's states (attitude w, x, y, z; angular velocity, rad/s, or momentum, N.m.s; momenta of wheels) and their
   rates stand among the values. */
static inline double *instance_states(Instance *instance) {
    return &instance->now.values[REFERENCE_STATES];
}
static inline double *instance_rates(Instance *instance) {
    return &instance->now.values[REFERENCE_DERIVATIVES];
}

/* Attitude, angular velocity and momenta of wheels. */
static inline double *instance_x(Instance *instance) {
    return STATE_IS_MOMENTUM ? instance->now.x : instance_states(instance);
}

/* Ends the instance. */
static inline void instance_terminate(Instance *instance) {
    if (instance->now.state != TERMINATED) instance->now.ended_in = instance->now.state;
    instance->now.state = TERMINATED;
}

/* What follows from attitude, angular velocity or states has to be computed anew. */
static inline void instance_state_moved(Instance *instance) {
    instance->outputs_are_current = instance->rates_are_current = false;
    if (STATE_IS_MOMENTUM) instance->mirror_is_current = false;
}

#if FIELD
/* Gives the model the inputs u as they are, with the place that the centre has come to. */
static inline void instance_act_at_place(Instance *instance) {
    memcpy(instance->acting, &instance->now.values[REFERENCE_TORQUE], sizeof instance->acting);
    memcpy(&instance->acting[FIELD_PLACE], instance->now.place, sizeof instance->now.place);
}
#endif

/* Points the first arguments of the model's functions to x, u, c, a, and the errors. Of ode and response the first
   one is the states instead. */
static inline void instance_set_arguments(Instance *instance) {
    instance->arg[0] = instance_x(instance);
    instance->arg[1] = &instance->now.values[REFERENCE_TORQUE];
#if FIELD
    if (instance->now.place_holds && !instance->moves) instance_act_at_place(instance);
    if (instance->now.place_holds || instance->moves) instance->arg[1] = instance->acting;
#endif
    instance->arg[2] = instance->now.c;
    instance->arg[3] = instance->now.a;
    instance->arg[4] = instance->now.errors;
}
static inline void instance_set_state_arguments(Instance *instance) {
    instance_set_arguments(instance);
    instance->arg[0] = instance_states(instance);
}

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

/* Takes the states at the start from the parameters, the attitude at length 1; with the rate those of wheels. */
Status instance_start_attitude(Instance *instance);
void instance_start_rate(Instance *instance);

#endif
