/* Calls the FMI functions of a scene in random order with random arguments, and checks what holds whatever is called:

   - a call that the state or its arguments forbid is an error, one that they allow is none;
   - a call not answered with OK logs one line, of its status and with its name, if that category is on;
   - after a discarded call, and after an error, everything reads bit for bit as before the call;
   - after an error nothing goes on but reading, saved states and a reset;
   - the attitude of a running instance is finite and unit, and its time the one that the importer knows.

   Linked with the sources of the FMU, with -DFMI=2 or -DFMI=3; sanitizers see what those do wrong.

       fuzz SEED CALLS

   prints how the calls were answered, calls per second, and a digest of all answers, the same for each build of the
   same sources. Exit status 1: a rule was broken, and stderr says which and where; 2: a call did not return. */
#define _POSIX_C_SOURCE 200809L

#include <float.h>
#include <limits.h>
#include <math.h>
#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "prelude.h"
#include "variable_table.h"

#if FMI == 3
#include "fmi3Functions.h"
#define EITHER(two, three) three
#else
#include "fmi2Functions.h"
#define EITHER(two, three) two
#endif

enum { OK, WARNING, DISCARD, ERROR, NOT_CALLED };
enum { INSTANTIATED = 1, INITIALIZATION = 2, STEPPING = 4, EVENT = 8, CONTINUOUS = 16, TERMINATED = 32, ALL = 63 };
enum { NO_STEPS = 64 }; /* of model exchange only */
enum { BEFORE_START = INSTANTIATED | INITIALIZATION, EXCHANGING = EVENT | CONTINUOUS, RUNNING = STEPPING | EXCHANGING };
enum { SLOTS = 6, SAVED = 3, BLOBS = 4, MOST = 12, PATIENCE = 300 };
enum { INPUT_COUNT = INPUT_P_COUNT + INPUT_K_COUNT + INPUT_U_COUNT, HAS_EVENT_MODE = FMI == 3 && DOCK_COUNT > 0 };

static const double UNIT_TOLERANCE = 8.0 * DBL_EPSILON; /* 2 EPSILON a component, and the norm's own rounding */

/* What a call must be answered with. */
typedef enum { ANYTHING, AN_ERROR, NO_ERROR, A_DISCARD, FINE } Expected;

/* What an importer knows of an instance. */
typedef struct {
    unsigned state;
    double time;
    bool stops;
} Known;

typedef struct {
    void *component; /* NULL: none */
    bool exchange, events, early_allowed, listens, has_log; /* events: co-simulation with event mode */
    unsigned log_mask; /* 1: discarded, 2: errors */
    Known now, known[SAVED];
    void *saved[SAVED], *before;
    unsigned lines; /* logged since the call began */
    int line_status;
    bool line_named, inner_error; /* a call within a step was an error */
} Slot;

/* A serialised state, whole or damaged. */
typedef struct {
    unsigned char *bytes;
    size_t size;
    bool exchange, whole;
    Known known;
} Blob;

typedef struct {
    int status;
    Expected expected;
} Answer;

static const Answer NOTHING = {NOT_CALLED, ANYTHING};

static Slot slots[SLOTS];
static Blob blobs[BLOBS];
static const char *called = ""; /* the FMI function being called */
static unsigned long long seed, call_count;
static unsigned long answered[4], steps_taken;
static uint64_t random_state, digest = UINT64_C(14695981039346656037);
static unsigned attitude_reference;
static char last_line[1024]; /* logged */

static void fail(const char *rule, const Slot *slot, int status) {
    fprintf(stderr, "seed %llu, call %llu, %s in state %u of %s answered %d: %s; logged last: %s\n", seed, call_count,
            called, slot->now.state, slot->exchange ? "model exchange" : "co-simulation", status, rule, last_line);
    exit(1);
}

static void hung(int number) {
    static const char text[] = "a call did not return\n";
    (void)number;
    _exit(write(2, text, sizeof text - 1) < 0 ? 3 : 2);
}

/* Random choices: xorshift64*. */

static uint64_t draw(void) {
    random_state ^= random_state >> 12;
    random_state ^= random_state << 25;
    random_state ^= random_state >> 27;
    return random_state * UINT64_C(2685821657736338717);
}

static unsigned below(unsigned count) {
    return (unsigned)((draw() >> 33) % count);
}

static bool once_in(unsigned count) {
    return below(count) == 0;
}

static double uniform(double low, double high) {
    return low + (high - low) * ((double)(draw() >> 11) / 9007199254740992.0);
}

/* A torque [N m] under which a step begins and is refused after some sub-steps. */
static const double SPINNING_UP = 2e18;

/* None is such that a step would need millions of sub-steps and yet be taken. */
static double odd_number(void) {
    static const double odd[] = {0.0,    -0.0,  1.0,    -1.0,  5e-324, -1e-310,  DBL_MIN, 1e-200,
                                 1e-150, 1e150, -1e150, 1e200, 1e308,  -DBL_MAX, 0.1,     DBL_EPSILON};
    return odd[below(sizeof odd / sizeof odd[0])];
}

static double no_number(void) {
    return once_in(2) ? (double)NAN : once_in(2) ? (double)INFINITY : -(double)INFINITY;
}

/* A value for a variable: mostly near the scene's, now and then odd, seldom not finite. */
static double value_for(unsigned reference) {
    if (once_in(300)) return no_number();
    if (reference >= VARIABLE_COUNT || once_in(60)) return odd_number();
    const Variable *variable = &VARIABLES[reference];
    if (variable->role == ROLE_STATE || variable->role == ROLE_PARAMETER) return uniform(-1.0, 1.0);
    if (reference >= REFERENCE_TORQUE && variable->role == ROLE_INPUT)
        return once_in(10) ? SPINNING_UP : uniform(-1e3, 1e3);
    return variable->start == 0.0 ? uniform(0.0, 0.1) : variable->start * uniform(0.95, 1.05);
}

static bool is_boolean(unsigned reference) {
#if DOCK_COUNT
    return reference < VARIABLE_COUNT && VARIABLES[reference].type == TYPE_BOOLEAN;
#else
    (void)reference;
    return false;
#endif
}

/* Of a number. */
static unsigned reference_of(Role role) {
    unsigned reference = below(VARIABLE_COUNT);
    while (VARIABLES[reference].role != role || is_boolean(reference)) reference = (reference + 1) % VARIABLE_COUNT;
    return reference;
}

static unsigned any_reference(void) {
    const unsigned reference = below(VARIABLE_COUNT);
    if (!once_in(150)) return is_boolean(reference) && !once_in(20) ? (unsigned)REFERENCE_TIME : reference;
    return once_in(2) ? (unsigned)VARIABLE_COUNT : once_in(2) ? UINT_MAX : (unsigned)draw();
}

/* An array on the heap of just this size, so that a sanitizer sees what reaches beyond it. */
static void *array(size_t count, size_t size) {
    void *bytes = calloc(count + (count == 0), size);
    if (!bytes) abort();
    return bytes;
}

static void note(const void *bytes, size_t size) {
    for (size_t i = 0; i < size; i++) digest = (digest ^ ((const unsigned char *)bytes)[i]) * UINT64_C(1099511628211);
}

static void note_values(const double values[], size_t count) {
    for (size_t i = 0; i < count; i++) {
        const double value = isnan(values[i]) ? 0.5 : values[i]; /* the bits of a NaN are the machine's */
        note(&value, sizeof value);
    }
}

/* The log. */

static void logged(Slot *slot, int status, const char *category, const char *message) {
    if (status <= WARNING) return;
    const size_t length = strlen(called);
    slot->lines++;
    slot->line_status = status;
    snprintf(last_line, sizeof last_line, "%s", message);
    slot->line_named = strncmp(message, called, length) == 0 && message[length] == ':' && strlen(message) < 1024 &&
                       strcmp(category, status == ERROR ? "logStatusError" : "logStatusDiscard") == 0;
}

#if FMI == 3
static void log_message(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String text) {
    logged(environment, (int)status, category, text);
}
#else
static void log_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                        fmi2String text, ...) {
    (void)name;
    logged(environment, (int)status, category, text);
}
#endif

/* Functions that the checks use too. */

static int get_values(Slot *slot, const unsigned references[], size_t count, double values[], size_t value_count) {
    called = EITHER("fmi2GetReal", "fmi3GetFloat64");
    (void)value_count;
#if FMI == 3
    return (int)fmi3GetFloat64(slot->component, references, count, values, value_count);
#else
    return (int)fmi2GetReal(slot->component, references, count, values);
#endif
}

static int set_values(Slot *slot, const unsigned references[], size_t count, const double values[],
                      size_t value_count) {
    called = EITHER("fmi2SetReal", "fmi3SetFloat64");
    (void)value_count;
#if FMI == 3
    return (int)fmi3SetFloat64(slot->component, references, count, values, value_count);
#else
    return (int)fmi2SetReal(slot->component, references, count, values);
#endif
}

#if DOCK_COUNT

typedef EITHER(fmi2Boolean, fmi3Boolean) Boolean;

static int get_booleans(Slot *slot, const unsigned references[], size_t count, Boolean values[], size_t value_count) {
    called = EITHER("fmi2GetBoolean", "fmi3GetBoolean");
    (void)value_count;
#if FMI == 3
    return (int)fmi3GetBoolean(slot->component, references, count, values, value_count);
#else
    return (int)fmi2GetBoolean(slot->component, references, count, values);
#endif
}

static int set_booleans(Slot *slot, const unsigned references[], size_t count, const Boolean values[],
                        size_t value_count) {
    called = EITHER("fmi2SetBoolean", "fmi3SetBoolean");
    (void)value_count;
#if FMI == 3
    return (int)fmi3SetBoolean(slot->component, references, count, values, value_count);
#else
    return (int)fmi2SetBoolean(slot->component, references, count, values);
#endif
}

#endif

static int save(Slot *slot, void **saved) {
    called = EITHER("fmi2GetFMUstate", "fmi3GetFMUState");
    return (int)EITHER(fmi2GetFMUstate, fmi3GetFMUState)(slot->component, saved);
}

static int restore(Slot *slot, void *saved) {
    called = EITHER("fmi2SetFMUstate", "fmi3SetFMUState");
    return (int)EITHER(fmi2SetFMUstate, fmi3SetFMUState)(slot->component, saved);
}

static int reset(Slot *slot) {
    called = EITHER("fmi2Reset", "fmi3Reset");
    return (int)EITHER(fmi2Reset, fmi3Reset)(slot->component);
}

static void free_state(Slot *slot, void **saved) {
    called = EITHER("fmi2FreeFMUstate", "fmi3FreeFMUState");
    if ((int)EITHER(fmi2FreeFMUstate, fmi3FreeFMUState)(slot->component, saved) != OK || *saved)
        fail("a state cannot be freed", slot, ERROR);
}

/* What is expected of a call that is allowed in some states, with arguments that are right or not. */
static Expected expect(const Slot *slot, unsigned states, bool right) {
    if (!(slot->now.state & states) || !right) return AN_ERROR;
    return FMI == 3 ? NO_ERROR : ANYTHING;
}

/* The same for a function of one interface. */
static Expected expect_of(const Slot *slot, bool exchange, unsigned states, bool right) {
    return expect(slot, slot->exchange == exchange ? states : 0, right);
}

/* Life cycle. */

#if FMI == 3
static int forbidden(Slot *slot) {
    const unsigned reference = REFERENCE_TIME;
    const double value = 0.0;
    switch (below(6)) {
        case 0: return set_values(slot, &reference, 1, &value, 1);
        case 1: return reset(slot);
        case 2: return restore(slot, slot->before);
        case 3: called = "fmi3Terminate"; return (int)fmi3Terminate(slot->component);
        case 4: called = "fmi3ExitInitializationMode"; return (int)fmi3ExitInitializationMode(slot->component);
        default: called = "fmi3EnterEventMode"; return (int)fmi3EnterEventMode(slot->component);
    }
}

/* Reads within a step: the attitude always can be, and any output unless it is beyond all numbers. */
static void read_within_step(Slot *slot) {
    double values[OUTPUT_COUNT];
    unsigned references[OUTPUT_COUNT];
    const unsigned lines = slot->lines, first = once_in(2) ? attitude_reference : (unsigned)REFERENCE_OUTPUTS;
    const size_t count = first == attitude_reference ? 4 : OUTPUT_COUNT;
    for (unsigned i = 0; i < count; i++) references[i] = first + i;
    const int status = get_values(slot, references, count, values, count);
    if (status != OK && !(status == DISCARD && first != attitude_reference))
        fail("outputs cannot be read within a step", slot, status);
    if (status == OK) note_values(values, count);
    slot->lines = lines; /* the step's own are counted */
}

/* The intermediate update: reads, asks for an early end, now and then breaks rules. */
static void updated(fmi3InstanceEnvironment environment, fmi3Float64 time, fmi3Boolean set_requested,
                    fmi3Boolean get_allowed, fmi3Boolean finished, fmi3Boolean can_return, fmi3Boolean *wanted,
                    fmi3Float64 *end) {
    Slot *slot = environment;
    const char *outer = called;
    if (set_requested || !get_allowed || !finished || can_return != slot->early_allowed)
        fail("the flags of an intermediate update are wrong", slot, OK);
    note_values(&time, 1);
    if (once_in(2)) read_within_step(slot);
    *wanted = once_in(8);
    if (once_in(4)) *end = once_in(9) ? no_number() : time + uniform(-1.0, 2.0);
    for (unsigned k = once_in(100) ? 1 + below(3) : 0; k > 0; k--) {
        const unsigned lines = slot->lines;
        const int status = forbidden(slot);
        if (status != ERROR) fail("a call that is forbidden within a step is no error", slot, status);
        if (slot->lines - lines != slot->log_mask >> 1) fail("an error within a step did not log one line", slot, status);
        slot->inner_error = true;
    }
    called = outer;
}

/* Returns whether the arguments drawn beside name and token are right. */
static bool instantiate(Slot *slot, const char *name, const char *token, bool log_on) {
    const fmi3LogMessageCallback log = slot->has_log ? log_message : NULL;
    if (slot->exchange) {
        called = "fmi3InstantiateModelExchange";
        slot->component = fmi3InstantiateModelExchange(name, token, NULL, false, log_on, slot, log);
        return true;
    }
    const unsigned required[2] = {REFERENCE_OUTPUTS, once_in(20) ? any_reference() : attitude_reference};
    const size_t count = below(3);
    const bool output = count < 2 || (required[1] < VARIABLE_COUNT && VARIABLES[required[1]].role == ROLE_OUTPUT);
    const bool event_mode = once_in(HAS_EVENT_MODE ? 2 : 40), null = once_in(40);
    slot->events = event_mode;
    slot->early_allowed = once_in(2);
    slot->listens = once_in(2);
    called = "fmi3InstantiateCoSimulation";
    slot->component = fmi3InstantiateCoSimulation(name, token, NULL, false, log_on, event_mode, slot->early_allowed,
                                                  null ? NULL : required, count, slot, log,
                                                  slot->listens ? updated : NULL);
    return (!event_mode || HAS_EVENT_MODE) && output && (!null || count == 0);
}
#else
static bool instantiate(Slot *slot, const char *name, const char *token, bool log_on) {
    static fmi2CallbackFunctions callbacks[SLOTS]; /* must live as long as their instances */
    fmi2CallbackFunctions *own = &callbacks[slot - slots];
    const fmi2CallbackFunctions filled = {log_message, NULL, NULL, NULL, slot};
    const int type = once_in(40) ? 7 : slot->exchange ? (int)fmi2ModelExchange : (int)fmi2CoSimulation;
    memcpy((void *)own, &filled, sizeof filled);
    called = "fmi2Instantiate";
    slot->component = fmi2Instantiate(name, (fmi2Type)type, token, NULL, slot->has_log ? own : NULL, false, log_on);
    return type != 7;
}
#endif

static void make_instance(Slot *slot) {
    const char *name = !once_in(20) ? "it" : once_in(2) ? NULL : " \t";
    const char *token = !once_in(20) ? MODEL_TOKEN : once_in(2) ? NULL : "{0}";
    const bool log_on = !once_in(4);
    memset(slot, 0, sizeof *slot);
    slot->exchange = once_in(2);
    slot->has_log = !once_in(8);
    const bool good = instantiate(slot, name, token, log_on) && name && name[0] == 'i' && token == MODEL_TOKEN;
    if (good != (slot->component != NULL)) fail("an instance is made if and only if all arguments are right", slot, OK);
    if (slot->lines != (!good && slot->has_log)) fail("only a refused instantiation logs one line", slot, OK);
    slot->log_mask = slot->has_log && log_on ? 3 : 0;
    slot->now.state = INSTANTIATED;
}

static void free_slot(Slot *slot) {
    if (!slot->component) return;
    for (size_t i = 0; i < SAVED; i++) free_state(slot, &slot->saved[i]);
    free_state(slot, &slot->before);
    EITHER(fmi2FreeInstance, fmi3FreeInstance)(slot->component);
    slot->component = NULL;
}

static Answer enter(Slot *slot) {
    const double start = once_in(30) ? no_number() : once_in(4) ? uniform(-1e5, 1e5) : 0.0;
    const bool stops = once_in(8);
    const double stop = once_in(8) ? no_number() : start + uniform(-1.0, 1e3);
    const bool given = once_in(2);
    const double tolerance = once_in(20) ? odd_number() : pow(10.0, uniform(-15.0, -1.0));
    const bool used = given && ERROR_CONTROLLED && !slot->exchange;
    const bool right =
        isfinite(start) && (!stops || stop >= start) && (!used || (tolerance >= 1e-15 && tolerance <= 0.1));
    Answer answer = {OK, expect(slot, INSTANTIATED, right)};
#if FMI == 3
    called = "fmi3EnterInitializationMode";
    answer.status = (int)fmi3EnterInitializationMode(slot->component, given, tolerance, start, stops, stop);
    if (answer.status == OK) slot->now = (Known){INITIALIZATION, start, stops};
#else
    if (once_in(2)) {
        called = "fmi2SetupExperiment";
        answer.status = (int)fmi2SetupExperiment(slot->component, given, tolerance, start, stops, stop);
        if (answer.status == OK) slot->now = (Known){INSTANTIATED, start, stops};
        return answer;
    }
    called = "fmi2EnterInitializationMode";
    answer.expected = expect(slot, INSTANTIATED, true);
    answer.status = (int)fmi2EnterInitializationMode(slot->component);
    if (answer.status == OK) slot->now.state = INITIALIZATION;
#endif
    return answer;
}

static Answer leave(Slot *slot) {
    called = EITHER("fmi2ExitInitializationMode", "fmi3ExitInitializationMode");
    Answer answer = {OK, expect(slot, INITIALIZATION, true)};
    answer.status = (int)EITHER(fmi2ExitInitializationMode, fmi3ExitInitializationMode)(slot->component);
    if (answer.status == OK) slot->now.state = slot->exchange || slot->events ? EVENT : STEPPING;
    return answer;
}

static Answer terminate(Slot *slot) {
    if (!once_in(8)) return NOTHING;
    called = EITHER("fmi2Terminate", "fmi3Terminate");
    Answer answer = {OK, expect(slot, RUNNING, true)};
    answer.status = (int)EITHER(fmi2Terminate, fmi3Terminate)(slot->component);
    if (answer.status == OK) slot->now.state = TERMINATED;
    return answer;
}

static Answer start_again(Slot *slot) {
    if (slot->now.state != TERMINATED && !once_in(20)) return NOTHING;
    const Answer answer = {reset(slot), FINE};
    slot->now = (Known){INSTANTIATED, 0.0, false};
    return answer;
}

static Answer set_logging(Slot *slot) {
    static const char *const names[] = {"logStatusDiscard", "logStatusError", "logComposite", "logAll", "log", NULL};
    static const unsigned masks[] = {1, 2, 0, 3, 0, 0};
    const bool on = !once_in(4), null = once_in(20);
    const size_t count = below(4);
    const char *chosen[4] = {NULL, NULL, NULL, NULL};
    unsigned mask = count == 0 ? 3 : 0;
    bool right = count == 0 || !null;
    for (size_t i = 0; i < count; i++) {
        const unsigned k = once_in(20) ? 4 + below(2) : below(4);
        chosen[i] = names[k];
        mask |= masks[k];
        right = right && k < 4;
    }
    called = EITHER("fmi2SetDebugLogging", "fmi3SetDebugLogging");
    Answer answer = {OK, right ? FINE : AN_ERROR};
    answer.status = (int)EITHER(fmi2SetDebugLogging, fmi3SetDebugLogging)(slot->component, on, count,
                                                                          null ? NULL : chosen);
    if (answer.status == OK) slot->log_mask = on && slot->has_log ? mask : 0;
    return answer;
}

/* Values. */

static Answer get(Slot *slot) {
    const size_t count = below(MOST), value_count = FMI == 3 && once_in(40) ? count + 1 : count;
    unsigned *references = array(count, sizeof *references);
    double *values = array(count, sizeof *values);
    bool right = value_count == count;
    for (size_t i = 0; i < count; i++) {
        references[i] = any_reference();
        right = right && references[i] < VARIABLE_COUNT && !is_boolean(references[i]);
    }
    const bool no_references = once_in(60), no_values = once_in(60);
    right = right && (count == 0 || !(no_references || no_values));
    Answer answer = {OK, expect(slot, FMI == 3 ? ALL : ALL & ~INSTANTIATED, right)};
    if (FMI == 2 && count == 0 && slot->now.state != INSTANTIATED) answer.expected = FINE;
    answer.status = get_values(slot, no_references ? NULL : references, count, no_values ? NULL : values, value_count);
    if (answer.status == OK) note_values(values, count);
    free(references);
    free(values);
    return answer;
}

static bool settable(const Slot *slot, unsigned reference) {
    if (reference >= VARIABLE_COUNT || is_boolean(reference)) return false;
    switch (VARIABLES[reference].role) {
        case ROLE_INPUT: return true;
        case ROLE_PARAMETER: return (slot->now.state & BEFORE_START) != 0;
        case ROLE_STATE: return slot->exchange && (slot->now.state & EXCHANGING) != 0;
        default: return false;
    }
}

static unsigned reference_to_set(const Slot *slot) {
    if (once_in(150)) return any_reference();
    if ((slot->now.state & BEFORE_START) && once_in(2)) return reference_of(ROLE_PARAMETER);
    if (slot->exchange && (slot->now.state & EXCHANGING) && once_in(3)) return reference_of(ROLE_STATE);
    return reference_of(ROLE_INPUT);
}

static Answer set(Slot *slot) {
    const size_t count = 1 + below(4), value_count = FMI == 3 && once_in(60) ? count - 1 : count;
    unsigned *references = array(count, sizeof *references);
    double *values = array(count, sizeof *values), back = 0.0;
    bool right = value_count == count, finite = true, judged = false;
    for (size_t i = 0; i < count; i++) {
        references[i] = reference_to_set(slot);
        values[i] = value_for(references[i]);
        /* states go with the inputs set before them */
        judged = judged || (CHANGES && slot->now.state == EVENT && references[i] >= REFERENCE_STATES);
        right = right && settable(slot, references[i]);
        finite = finite && isfinite(values[i]);
    }
    const bool no_references = once_in(60), no_values = once_in(60);
    const bool given = value_count == count && !no_references && !no_values;
    Answer answer = {OK, ANYTHING};
    if (!(slot->now.state & (BEFORE_START | RUNNING)) || !given || (!right && finite)) answer.expected = AN_ERROR;
    else if (right) answer.expected = !finite ? A_DISCARD : judged ? NO_ERROR : FINE;
    answer.status = set_values(slot, no_references ? NULL : references, count, no_values ? NULL : values, value_count);
    if (answer.status == OK && (FMI == 3 || slot->now.state != INSTANTIATED) &&
        VARIABLES[references[count - 1]].role != ROLE_STATE) {
        const char *name = called;
        if (get_values(slot, &references[count - 1], 1, &back, 1) != OK || back != values[count - 1])
            fail("a value that was set does not read back", slot, OK);
        called = name;
    }
    free(references);
    free(values);
    return answer;
}

/* Sets all inputs near the scene's, so that the instance can go on. */
static Answer set_good_inputs(Slot *slot) {
    unsigned references[INPUT_COUNT + 1];
    double values[INPUT_COUNT + 1];
    size_t count = 0;
    for (unsigned i = REFERENCE_P; i < REFERENCE_P + INPUT_COUNT; i++) {
        if (is_boolean(i)) continue;
        references[count] = i;
        values[count++] = VARIABLES[i].start * uniform(0.99, 1.01);
    }
    Answer answer = {OK, slot->now.state & (BEFORE_START | RUNNING) ? FINE : AN_ERROR};
    answer.status = set_values(slot, references, count, values, count);
    return answer;
}

#if DOCK_COUNT

static unsigned boolean_reference(void) {
    unsigned reference = below(VARIABLE_COUNT);
    if (once_in(100)) return any_reference();
    while (!is_boolean(reference)) reference = (reference + 1) % VARIABLE_COUNT;
    return reference;
}

static Answer get_some_booleans(Slot *slot) {
    const size_t count = below(4), value_count = FMI == 3 && once_in(40) ? count + 1 : count;
    unsigned *references = array(count, sizeof *references);
    Boolean *values = array(count, sizeof *values);
    bool right = value_count == count;
    for (size_t i = 0; i < count; i++) {
        references[i] = boolean_reference();
        right = right && is_boolean(references[i]);
    }
    const bool null = once_in(60);
    right = right && (count == 0 || !null);
    Answer answer = {OK, expect(slot, FMI == 3 ? ALL : ALL & ~INSTANTIATED, right)};
    if (answer.expected != AN_ERROR) answer.expected = FINE;
    answer.status = get_booleans(slot, references, count, null ? NULL : values, value_count);
    for (size_t i = 0; i < count && answer.status == OK; i++) {
        const double value = values[i] ? 1.0 : 0.0;
        note_values(&value, 1);
    }
    free(references);
    free(values);
    return answer;
}

/* Opens and closes docks; where that has to wait for an event, mostly sets what is. */
static Answer set_some_booleans(Slot *slot) {
    const size_t count = below(3), value_count = FMI == 3 && once_in(60) ? count + 1 : count;
    const bool held = (slot->now.state & (slot->events ? STEPPING | CONTINUOUS : CONTINUOUS)) != 0;
    const bool null = once_in(60), keep = held && !once_in(10);
    unsigned *references = array(count, sizeof *references);
    Boolean *values = array(count, sizeof *values), back = 0;
    bool right = value_count == count && (count == 0 || !null);
    for (size_t i = 0; i < count; i++) {
        references[i] = boolean_reference();
        right = right && is_boolean(references[i]);
        if (!right) continue;
        values[i] = once_in(3) ? VARIABLES[references[i]].start == 0.0 : VARIABLES[references[i]].start != 0.0;
        if (!held) continue;
        if (get_booleans(slot, &references[i], 1, &back, 1) != OK) fail("a Boolean cannot be read", slot, ERROR);
        if (keep) values[i] = back;
        right = right && !values[i] == !back;
    }
    Answer answer = {OK, expect(slot, BEFORE_START | RUNNING, right)};
    if (answer.expected != AN_ERROR) answer.expected = FINE;
    answer.status = set_booleans(slot, references, count, null ? NULL : values, value_count);
    if (answer.status == OK && count > 0 && (FMI == 3 || slot->now.state != INSTANTIATED)) {
        const char *name = called;
        if (get_booleans(slot, &references[count - 1], 1, &back, 1) != OK || !back != !values[count - 1])
            fail("a Boolean that was set does not read back", slot, OK);
        called = name;
    }
    free(references);
    free(values);
    return answer;
}

#endif

/* Steps. */

static double step_size(void) {
    static const double odd[] = {0.0, -0.0, -1.0, 5e-324, 1e-300, 1e-9, 1e300, DBL_MAX, DBL_EPSILON};
    if (once_in(200)) return no_number();
    return once_in(30) ? odd[below(sizeof odd / sizeof odd[0])] : uniform(1e-3, 2.0);
}

static Answer step(Slot *slot) {
    const double size = step_size();
    const double time = !once_in(60) ? slot->now.time : once_in(2) ? no_number() : slot->now.time + 1e6;
    const bool right = size > 0.0 && isfinite(time + size) && time == slot->now.time;
    Answer answer = {OK, AN_ERROR};
    if (slot->now.state == STEPPING && right) answer.expected = slot->now.stops ? ANYTHING : NO_ERROR;
#if FMI == 3
    bool flags[3] = {true, true, true};
    double last = -1.0;
    const unsigned missing = once_in(60) ? below(4) : 4;
    if (missing < 4 || slot->now.state != STEPPING) answer.expected = AN_ERROR;
    called = "fmi3DoStep";
    answer.status = (int)fmi3DoStep(slot->component, time, size, once_in(2), missing == 0 ? NULL : &flags[0],
                                    missing == 1 ? NULL : &flags[1], missing == 2 ? NULL : &flags[2],
                                    missing == 3 ? NULL : &last);
    if (answer.status <= DISCARD) {
        const bool early = flags[2];
        const double end = answer.status == OK ? time + size : time;
        if (flags[0] || flags[1]) fail("a step asks for an event or an end", slot, answer.status);
        if (early ? !(slot->early_allowed && slot->listens && last >= time && last <= end) : last != end)
            fail("a step did not end where it says", slot, answer.status);
        note_values(&last, 1);
        if (answer.status == OK) slot->now.time = last;
    }
#else
    called = "fmi2DoStep";
    if (slot->now.state != STEPPING) answer.expected = AN_ERROR;
    answer.status = (int)fmi2DoStep(slot->component, time, size, once_in(2));
    if (answer.status == OK) slot->now.time = time + size;
#endif
    steps_taken += answer.status == OK;
    return answer;
}

#if FMI == 2
static Answer step_status(Slot *slot) {
    double last = -1.0;
    const int kind = (int)below(5);
    const bool null = once_in(40);
    called = "fmi2GetRealStatus";
    Answer answer = {OK, expect_of(slot, false, STEPPING | TERMINATED, true)};
    if (answer.expected == ANYTHING && kind == (int)fmi2LastSuccessfulTime) answer.expected = null ? AN_ERROR : FINE;
    else if (answer.expected == ANYTHING) answer.expected = A_DISCARD;
    answer.status = (int)fmi2GetRealStatus(slot->component, (fmi2StatusKind)kind, null ? NULL : &last);
    if (answer.status == OK && slot->now.state == STEPPING && last != slot->now.time)
        fail("the last successful time is not the instance's", slot, OK);
    return answer;
}
#endif

/* Derivatives. */

static unsigned unknown_reference(const Slot *slot) {
    if (once_in(200)) return any_reference();
    if ((slot->now.state & BEFORE_START) && once_in(3)) return reference_of(ROLE_STATE);
    return reference_of(once_in(3) ? ROLE_DERIVATIVE : ROLE_OUTPUT);
}

static unsigned known_reference(const Slot *slot) {
    if (once_in(200)) return any_reference();
    if (once_in(20)) return REFERENCE_TIME;
    if (once_in(2)) return reference_of(slot->now.state & BEFORE_START ? ROLE_PARAMETER : ROLE_STATE);
    return reference_of(ROLE_INPUT);
}

static bool differentiable(const Slot *slot, unsigned reference, bool unknown) {
    const bool before = (slot->now.state & BEFORE_START) != 0;
    if (reference >= VARIABLE_COUNT || is_boolean(reference)) return false;
    switch (VARIABLES[reference].role) {
        case ROLE_TIME:
        case ROLE_INPUT: return !unknown;
        case ROLE_PARAMETER: return !unknown && before;
        case ROLE_STATE: return unknown == before;
        default: return unknown;
    }
}

static int ask_derivative(Slot *slot, bool adjoint, const unsigned *unknowns, size_t unknown_count,
                          const unsigned *knowns, size_t known_count, const double *seeds, size_t seed_count,
                          double *results, size_t result_count) {
#if FMI == 3
    called = adjoint ? "fmi3GetAdjointDerivative" : "fmi3GetDirectionalDerivative";
    return (int)(adjoint ? fmi3GetAdjointDerivative : fmi3GetDirectionalDerivative)(
        slot->component, unknowns, unknown_count, knowns, known_count, seeds, seed_count, results, result_count);
#else
    (void)adjoint, (void)seed_count, (void)result_count;
    called = "fmi2GetDirectionalDerivative";
    return (int)fmi2GetDirectionalDerivative(slot->component, unknowns, unknown_count, knowns, known_count, seeds,
                                             results);
#endif
}

static Answer derivative(Slot *slot) {
    const bool adjoint = FMI == 3 && once_in(2), null = once_in(60), long_seed = FMI == 3 && once_in(60);
    const size_t unknown_count = below(6), known_count = below(6);
    const size_t seed_count = adjoint ? unknown_count : known_count, result_count = unknown_count + known_count - seed_count;
    unsigned *unknowns = array(unknown_count, sizeof *unknowns), *knowns = array(known_count, sizeof *knowns);
    double *seeds = array(seed_count, sizeof *seeds), *results = array(result_count, sizeof *results);
    bool right = !long_seed && !(null && seed_count > 0), finite = true;
    for (size_t i = 0; i < unknown_count; i++) {
        unknowns[i] = unknown_reference(slot);
        right = right && differentiable(slot, unknowns[i], true);
    }
    for (size_t i = 0; i < known_count; i++) {
        knowns[i] = known_reference(slot);
        right = right && differentiable(slot, knowns[i], false);
    }
    for (size_t i = 0; i < seed_count; i++) {
        seeds[i] = once_in(100) ? no_number() : once_in(20) ? odd_number() : uniform(-1.0, 1.0);
        finite = finite && isfinite(seeds[i]);
    }
    Answer answer = {OK, expect(slot, INITIALIZATION | RUNNING | TERMINATED, right)};
    if (answer.expected == NO_ERROR && !finite) answer.expected = A_DISCARD;
    answer.status = ask_derivative(slot, adjoint, unknowns, unknown_count, knowns, known_count, null ? NULL : seeds,
                                   seed_count + long_seed, results, result_count);
    if (answer.status == OK) note_values(results, result_count);
    for (size_t i = 0; i < result_count && answer.status == OK; i++)
        if (!isfinite(results[i])) fail("a derivative is not finite", slot, OK);
    free(unknowns);
    free(knowns);
    free(seeds);
    free(results);
    return answer;
}

static Answer output_derivative(Slot *slot) {
    const size_t count = below(6);
    unsigned *references = array(count, sizeof *references);
    int32_t *orders = array(count, sizeof *orders);
    double *values = array(count, sizeof *values);
    bool right = true;
    for (size_t i = 0; i < count; i++) {
        references[i] = once_in(60) ? any_reference() : reference_of(ROLE_OUTPUT);
        orders[i] = once_in(60) ? (int32_t)below(4) - 1 : 1;
        right = right && references[i] < VARIABLE_COUNT && VARIABLES[references[i]].role == ROLE_OUTPUT && orders[i] == 1;
    }
    Answer answer = {OK, expect_of(slot, false, STEPPING | TERMINATED, right)};
#if FMI == 3
    called = "fmi3GetOutputDerivatives";
    answer.status = (int)fmi3GetOutputDerivatives(slot->component, references, count, orders, values, count);
#else
    called = "fmi2GetRealOutputDerivatives";
    answer.status = (int)fmi2GetRealOutputDerivatives(slot->component, references, count, orders, values);
#endif
    if (answer.status == OK) note_values(values, count);
    free(references);
    free(orders);
    free(values);
    return answer;
}

/* Model exchange. */

static Answer set_time(Slot *slot) {
    const double time = once_in(30) ? no_number() : slot->now.time + uniform(-1.0, 1.0);
    called = EITHER("fmi2SetTime", "fmi3SetTime");
    Answer answer = {OK, expect_of(slot, true, EXCHANGING, true)};
    answer.status = (int)EITHER(fmi2SetTime, fmi3SetTime)(slot->component, time);
    if (answer.status == OK) slot->now.time = time;
    if ((answer.status == OK) != (slot->exchange && (slot->now.state & EXCHANGING) && isfinite(time)))
        fail("time is set if and only if it is finite", slot, answer.status);
    return answer;
}

static Answer set_states(Slot *slot) {
    const size_t count = once_in(40) ? below(9) : STATE_COUNT;
    const bool null = once_in(60);
    double *values = array(count, sizeof *values);
    bool finite = true;
    for (size_t i = 0; i < count; i++) {
        values[i] = value_for(REFERENCE_STATES);
        finite = finite && isfinite(values[i]);
    }
    called = EITHER("fmi2SetContinuousStates", "fmi3SetContinuousStates");
    Answer answer = {OK, slot->now.state == CONTINUOUS && count == STATE_COUNT && !null ? FINE : AN_ERROR};
    if (answer.expected == FINE && !finite) answer.expected = A_DISCARD;
    answer.status = (int)EITHER(fmi2SetContinuousStates, fmi3SetContinuousStates)(slot->component, null ? NULL : values,
                                                                                  count);
    free(values);
    return answer;
}

static Answer get_states(Slot *slot) {
    const size_t count = once_in(40) ? below(9) : STATE_COUNT;
    const bool null = once_in(60), right = count == STATE_COUNT && !null;
    const unsigned started = INITIALIZATION | EXCHANGING | TERMINATED;
    double *values = array(count, sizeof *values), *given = null ? NULL : values;
    Answer answer = {OK, expect_of(slot, true, started, right)};
    switch (below(3)) {
        case 0:
            called = EITHER("fmi2GetContinuousStates", "fmi3GetContinuousStates");
            answer.status = (int)EITHER(fmi2GetContinuousStates, fmi3GetContinuousStates)(slot->component, given, count);
            break;
        case 1:
            called = EITHER("fmi2GetDerivatives", "fmi3GetContinuousStateDerivatives");
            answer.status = (int)EITHER(fmi2GetDerivatives, fmi3GetContinuousStateDerivatives)(slot->component, given, count);
            break;
        default:
            called = EITHER("fmi2GetNominalsOfContinuousStates", "fmi3GetNominalsOfContinuousStates");
            answer.expected = expect_of(slot, true, ALL, right);
            answer.status = (int)EITHER(fmi2GetNominalsOfContinuousStates, fmi3GetNominalsOfContinuousStates)(
                slot->component, given, count);
    }
    if (answer.status == OK) note_values(values, count);
    free(values);
    return answer;
}

static Answer get_indicators(Slot *slot) {
    double value = 0.0;
    const size_t count = once_in(8);
    called = EITHER("fmi2GetEventIndicators", "fmi3GetEventIndicators");
    Answer answer = {OK, expect_of(slot, true, INITIALIZATION | EXCHANGING | TERMINATED, count == 0)};
    answer.status = (int)EITHER(fmi2GetEventIndicators, fmi3GetEventIndicators)(slot->component, count ? &value : NULL,
                                                                                count);
    return answer;
}

static Answer update_discrete_states(Slot *slot) {
    const bool null = once_in(60);
#if FMI == 3
    bool flags[5] = {true, true, true, true, true};
    double time = 0.0;
    called = "fmi3UpdateDiscreteStates";
    Answer answer = {OK, expect(slot, EVENT, !null)};
    answer.status = (int)fmi3UpdateDiscreteStates(slot->component, &flags[0], &flags[1], null ? NULL : &flags[2],
                                                  &flags[3], &flags[4], &time);
    if (answer.status == OK && (flags[0] || flags[1] || flags[2] || (flags[3] && !CHANGES) || flags[4]))
        fail("an update asks for an event", slot, OK);
#else
    fmi2EventInfo info;
    memset(&info, 1, sizeof info);
    called = "fmi2NewDiscreteStates";
    Answer answer = {OK, expect(slot, EVENT, !null)};
    answer.status = (int)fmi2NewDiscreteStates(slot->component, null ? NULL : &info);
    if (answer.status == OK && (info.newDiscreteStatesNeeded || info.terminateSimulation || info.nextEventTimeDefined))
        fail("an update asks for an event", slot, OK);
#endif
    return answer;
}

#if FMI == 3 && DOCK_COUNT
static Answer step_mode(Slot *slot) {
    Answer answer = {OK, expect_of(slot, false, EVENT, true)};
    called = "fmi3EnterStepMode";
    answer.status = (int)fmi3EnterStepMode(slot->component);
    if (answer.status == OK) slot->now.state = STEPPING;
    return answer;
}
#endif

static Answer change_mode(Slot *slot) {
    Answer answer = {OK, ANYTHING};
    const unsigned before_event = EITHER(EXCHANGING, CONTINUOUS) | (slot->events ? STEPPING : 0);
    const bool wants_event = slot->exchange ? once_in(2) : slot->now.state != EVENT;
    if (!slot->exchange && !slot->events && !once_in(50)) return NOTHING;
#if FMI == 3 && DOCK_COUNT
    if (slot->events && slot->now.state == EVENT ? !once_in(50) : once_in(50)) return step_mode(slot);
    if (slot->events && slot->now.state == STEPPING && !once_in(8)) return NOTHING;
#endif
    if (wants_event) {
        called = EITHER("fmi2EnterEventMode", "fmi3EnterEventMode");
        answer.expected = slot->now.state & before_event ? FINE : AN_ERROR;
        answer.status = (int)EITHER(fmi2EnterEventMode, fmi3EnterEventMode)(slot->component);
        if (answer.status == OK) slot->now.state = EVENT;
        return answer;
    }
    called = EITHER("fmi2EnterContinuousTimeMode", "fmi3EnterContinuousTimeMode");
    answer.expected = slot->now.state != EVENT || !slot->exchange ? AN_ERROR : !CHANGES ? FINE : EITHER(ANYTHING, NO_ERROR);
    answer.status = (int)EITHER(fmi2EnterContinuousTimeMode, fmi3EnterContinuousTimeMode)(slot->component);
    if (answer.status == OK) slot->now.state = CONTINUOUS;
    return answer;
}

static Answer complete_step(Slot *slot) {
    const bool null = once_in(60);
    EITHER(fmi2Boolean, fmi3Boolean) event = true, end = true;
    called = EITHER("fmi2CompletedIntegratorStep", "fmi3CompletedIntegratorStep");
    Answer answer = {OK, slot->now.state == CONTINUOUS && !null ? FINE : AN_ERROR};
    answer.status = (int)EITHER(fmi2CompletedIntegratorStep, fmi3CompletedIntegratorStep)(
        slot->component, true, &event, null ? NULL : &end);
    if (answer.status == OK && (event || end)) fail("a completed step asks for an event", slot, OK);
    return answer;
}

/* Saved states. */

static Answer save_some(Slot *slot) {
    const unsigned k = below(SAVED);
    if (once_in(60)) return (Answer){save(slot, NULL), AN_ERROR};
    slot->known[k] = slot->now;
    return (Answer){save(slot, &slot->saved[k]), FINE};
}

static Answer restore_some(Slot *slot) {
    const unsigned k = below(SAVED);
    if (!slot->saved[k] && !once_in(20)) return NOTHING;
    const bool in_event = slot->saved[k] && slot->known[k].state == EVENT;
    const bool right = slot->saved[k] && (!in_event || slot->exchange || slot->events);
    const Answer answer = {restore(slot, slot->saved[k]), right ? FINE : AN_ERROR};
    if (answer.status == OK) slot->now = slot->known[k];
    return answer;
}

static Answer free_some(Slot *slot) {
    void *nothing = NULL;
    called = EITHER("fmi2FreeFMUstate", "fmi3FreeFMUState");
    if (once_in(8)) {
        void **given = once_in(2) ? NULL : &nothing;
        return (Answer){(int)EITHER(fmi2FreeFMUstate, fmi3FreeFMUState)(slot->component, given), FINE};
    }
    free_state(slot, &slot->saved[below(SAVED)]);
    return (Answer){OK, FINE};
}

static Answer serialize(Slot *slot) {
    const unsigned k = below(SAVED);
    Blob *blob = &blobs[below(BLOBS)];
    size_t size = 0;
    const bool there = slot->saved[k] != NULL, wrong = once_in(20);
    if (!there && !once_in(20)) return NOTHING;
    called = EITHER("fmi2SerializedFMUstateSize", "fmi3SerializedFMUStateSize");
    Answer answer = {OK, there ? FINE : AN_ERROR};
    answer.status = (int)EITHER(fmi2SerializedFMUstateSize, fmi3SerializedFMUStateSize)(slot->component, slot->saved[k],
                                                                                        &size);
    if (answer.status != OK) return answer;
    free(blob->bytes);
    *blob = (Blob){array(size, 1), size, slot->exchange, !wrong, slot->known[k]};
    called = EITHER("fmi2SerializeFMUstate", "fmi3SerializeFMUState");
    answer.expected = wrong ? AN_ERROR : FINE;
    answer.status = (int)EITHER(fmi2SerializeFMUstate, fmi3SerializeFMUState)(
        slot->component, slot->saved[k], (void *)blob->bytes, wrong ? size - 1 - below((unsigned)size - 1) : size);
    if (answer.status == OK) note(blob->bytes, 8);
    return answer;
}

/* Damages bytes in one of several ways. Returns how many are left. */
static size_t damage(unsigned char bytes[], size_t size) {
    switch (below(3)) {
        case 0: bytes[below((unsigned)size)] ^= (unsigned char)(1u << below(8)); return size;
        case 1: return below((unsigned)size);
        default:
            for (size_t i = once_in(2) ? 0 : 24; i < size; i++) bytes[i] = (unsigned char)draw();
            return size;
    }
}

static Answer deserialize(Slot *slot) {
    const Blob *blob = &blobs[below(BLOBS)];
    const unsigned k = below(SAVED);
    const bool whole = blob->whole && !once_in(8);
    if (!blob->bytes || (blob->exchange != slot->exchange && !once_in(8))) return NOTHING;
    unsigned char *bytes = array(blob->size, 1);
    memcpy(bytes, blob->bytes, blob->size);
    const size_t size = whole ? blob->size : damage(bytes, blob->size);
    void *state = NULL;
    called = EITHER("fmi2DeSerializeFMUstate", "fmi3DeserializeFMUState");
    Answer answer = {OK, whole ? FINE : AN_ERROR};
    answer.status = (int)EITHER(fmi2DeSerializeFMUstate, fmi3DeserializeFMUState)(slot->component, (void *)bytes, size,
                                                                                  &state);
    free(bytes);
    if (answer.status != OK) {
        if (state) fail("a refused state was made", slot, answer.status);
        return answer;
    }
    if (blob->exchange == slot->exchange) {
        free_state(slot, &slot->saved[k]);
        slot->saved[k] = state;
        slot->known[k] = blob->known;
        return answer;
    }
    answer = (Answer){restore(slot, state), AN_ERROR};
    const char *name = called;
    free_state(slot, &state);
    called = name;
    return answer;
}

/* Functions of what the FMU does not have; all in this version's header that are not called above. */

#if DOCK_COUNT
#define BOOLEAN(X)
#else
#define BOOLEAN(X) X(Boolean)
#endif

#if FMI == 3
#define OTHER_TYPES(X) \
    X(Float32) X(Int8) X(UInt8) X(Int16) X(UInt16) X(Int32) X(UInt32) X(Int64) X(UInt64) BOOLEAN(X) X(String)
#define PREFIXED(NAME) fmi3##NAME
#define TEXT(NAME) "fmi3" #NAME
#define SIZES_OF(count) , count
#else
#define OTHER_TYPES(X) X(Integer) BOOLEAN(X) X(String)
#define PREFIXED(NAME) fmi2##NAME
#define TEXT(NAME) "fmi2" #NAME
#define SIZES_OF(count)
#endif

static Answer other_type(Slot *slot) {
    unsigned choice = below(22);
    const unsigned reference = any_reference();
    const size_t count = once_in(8);
    Answer answer = {OK, count == 0 ? FINE : AN_ERROR};
#define ACCESS(TYPE)                                                                                           \
    if (choice-- == 0) {                                                                                       \
        called = TEXT(Get##TYPE);                                                                              \
        answer.status = (int)PREFIXED(Get##TYPE)(slot->component, &reference, count, NULL SIZES_OF(count));    \
        return answer;                                                                                         \
    }                                                                                                          \
    if (choice-- == 0) {                                                                                       \
        called = TEXT(Set##TYPE);                                                                              \
        answer.status = (int)PREFIXED(Set##TYPE)(slot->component, &reference, count, NULL SIZES_OF(count));    \
        return answer;                                                                                         \
    }
    OTHER_TYPES(ACCESS)
#undef ACCESS
    return NOTHING;
}

static Answer unsupported(Slot *slot) {
    Answer answer = {OK, AN_ERROR};
    void *component = slot->component;
    if (!once_in(20)) return NOTHING;
#define CALL(NAME, ARGUMENTS)                              \
    if (once_in(6)) {                                      \
        called = TEXT(NAME);                               \
        answer.status = (int)PREFIXED(NAME) ARGUMENTS;     \
        return answer;                                     \
    }
#if FMI == 3
    CALL(GetNumberOfVariableDependencies, (component, 0, NULL))
    CALL(GetVariableDependencies, (component, 0, NULL, NULL, NULL, NULL, 0))
    CALL(EnterConfigurationMode, (component))
    CALL(ExitConfigurationMode, (component))
    CALL(GetIntervalDecimal, (component, NULL, 1, NULL, NULL))
    CALL(GetIntervalFraction, (component, NULL, 1, NULL, NULL, NULL))
    CALL(GetShiftDecimal, (component, NULL, 1, NULL))
    CALL(GetShiftFraction, (component, NULL, 1, NULL, NULL))
    CALL(SetIntervalDecimal, (component, NULL, 1, NULL))
    CALL(SetIntervalFraction, (component, NULL, 1, NULL, NULL))
    CALL(SetShiftDecimal, (component, NULL, 1, NULL))
    CALL(SetShiftFraction, (component, NULL, 1, NULL, NULL))
    CALL(EvaluateDiscreteStates, (component))
#if !DOCK_COUNT
    CALL(EnterStepMode, (component))
#endif
    CALL(ActivateModelPartition, (component, 0, 0.0))
    CALL(GetBinary, (component, NULL, 1, NULL, NULL, 1))
    CALL(SetBinary, (component, NULL, 1, NULL, NULL, 1))
    CALL(GetClock, (component, NULL, 1, NULL))
    CALL(SetClock, (component, NULL, 1, NULL))
#else
    CALL(SetRealInputDerivatives, (component, NULL, 1, NULL, NULL))
    CALL(CancelStep, (component))
#endif
#undef CALL
    return NOTHING;
}

/* No instance: an error, and nothing to log to. */
static Answer without_instance(Slot *slot) {
    Slot nobody = *slot;
    void *state = NULL;
    nobody.component = NULL;
    int status = ERROR;
    switch (below(5)) {
        case 0: status = get_values(&nobody, NULL, 1, NULL, 1); break;
        case 1: status = set_values(&nobody, NULL, 1, NULL, 1); break;
        case 2: status = save(&nobody, &state); break;
        case 3: status = restore(&nobody, slot->before); break;
        default: status = reset(&nobody);
    }
    if (status != ERROR || slot->lines != 0) fail("a call without an instance is no error", slot, status);
    return NOTHING;
}

static Answer destroy(Slot *slot) {
    if (once_in(200)) free_slot(slot);
    return NOTHING;
}

/* The rules. */

/* Whether a variable reads the same in this state before and after a call that was not answered with OK. */
static bool comparable(const Slot *slot, unsigned state, int status, unsigned reference) {
    const Role role = VARIABLES[reference].role;
    if (role == ROLE_TIME || role == ROLE_INPUT || role == ROLE_PARAMETER) return true;
    const bool reading_may_end_it = FMI == 2 && !slot->exchange;
    if (state & BEFORE_START) return status == DISCARD && !reading_may_end_it;
    if (!reading_may_end_it) return true;
    if (role == ROLE_STATE) return !CHANGES || reference < REFERENCE_STATES + 4;
    return reference >= attitude_reference && reference < attitude_reference + 4;
}

static void read_all(Slot *slot, unsigned state, int status, double values[]) {
    for (unsigned i = 0; i < VARIABLE_COUNT; i++) {
        values[i] = 0.0;
#if DOCK_COUNT
        Boolean value = 0;
        if (is_boolean(i)) {
            values[i] = get_booleans(slot, &i, 1, &value, 1) != OK ? -12345.0 : value ? 1.0 : 0.0;
            continue;
        }
#endif
        if (comparable(slot, state, status, i) && get_values(slot, &i, 1, &values[i], 1) != OK) values[i] = -12345.0;
    }
}

/* After a call that was refused: reads everything, goes back to before the call, reads everything again. */
static void check_unchanged(Slot *slot, const Known *known, int status) {
    double after[VARIABLE_COUNT], before[VARIABLE_COUNT];
    const char *name = called;
    if (FMI == 2 && known->state == INSTANTIATED) return;
    read_all(slot, known->state, status, after);
    if (restore(slot, slot->before) != OK) fail("the state before a call cannot be restored", slot, ERROR);
    slot->now = *known;
    read_all(slot, known->state, status, before);
    called = name;
    for (unsigned i = 0; i < VARIABLE_COUNT; i++) {
        if (memcmp(&after[i], &before[i], sizeof after[i]) == 0) continue;
        fprintf(stderr, "%s was %.17g, is %.17g\n", VARIABLES[i].name, before[i], after[i]);
        fail("a refused call changed a value", slot, status);
    }
}

static void check_ended(Slot *slot) {
    const unsigned reference = REFERENCE_P;
    const double value = VARIABLES[reference].start;
    const char *name = called;
    if (set_values(slot, &reference, 1, &value, 1) != ERROR) fail("an instance goes on after an error", slot, ERROR);
    called = name;
}

static void check_running(Slot *slot) {
    const unsigned references[5] = {attitude_reference, attitude_reference + 1, attitude_reference + 2,
                                    attitude_reference + 3, REFERENCE_TIME};
    double q[5];
    const int status = get_values(slot, references, 5, q, 5);
    if (status != OK && !(slot->exchange && status == DISCARD)) fail("the attitude cannot be read", slot, status);
    if (status != OK) return;
    const double length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(fabs(length - 1.0) <= UNIT_TOLERANCE)) fail("the attitude is not unit", slot, status);
    if (q[4] != slot->now.time) fail("time is not what the importer knows", slot, status);
}

static bool as_expected(Answer answer) {
    switch (answer.expected) {
        case AN_ERROR: return answer.status == ERROR;
        case NO_ERROR: return answer.status != ERROR;
        case A_DISCARD: return answer.status == DISCARD;
        case FINE: return answer.status == OK;
        default: return true;
    }
}

static void check(Slot *slot, Answer answer, const Known *known, unsigned log_mask) {
    const bool refused = answer.status >= DISCARD;
    if (answer.status < OK || answer.status > ERROR) fail("is no status that this FMU answers", slot, answer.status);
    if (slot->inner_error) {
        if (answer.status != ERROR) fail("a step goes on after an error within it", slot, answer.status);
    } else {
        const bool line = (answer.status == DISCARD && (log_mask & 1)) || (answer.status == ERROR && (log_mask & 2));
        if (!as_expected(answer)) fail("is not what its state and arguments ask for", slot, answer.status);
        if (slot->lines != line) fail("a refused call logs one line if asked to, no other one does", slot, answer.status);
        if (line && (slot->line_status != answer.status || !slot->line_named))
            fail("the line has another status or name than the call", slot, answer.status);
    }
    answered[answer.status]++;
    note(&answer.status, sizeof answer.status);
    if (answer.status == ERROR) {
        slot->now = *known;
        slot->now.state = TERMINATED;
        check_ended(slot);
    }
    if (refused && !slot->inner_error && once_in(2)) check_unchanged(slot, known, answer.status);
    if ((slot->now.state & RUNNING) && once_in(4)) check_running(slot);
}

/* How often each call is made, and in which states mostly: what the state forbids is called seldom, or instances
   would hardly ever run. */
static const struct {
    Answer (*call)(Slot *);
    unsigned weight, states;
} CALLS[] = {
    {enter, 6, INSTANTIATED},
    {leave, 12, INITIALIZATION},
    {terminate, 2, RUNNING},
    {start_again, 4, ALL},
    {set_logging, 1, ALL},
    {get, 6, EITHER(ALL & ~INSTANTIATED, ALL)},
    {set, 6, ALL & ~TERMINATED},
    {set_good_inputs, 3, ALL & ~TERMINATED},
#if DOCK_COUNT
    {get_some_booleans, 2, EITHER(ALL & ~INSTANTIATED, ALL)},
    {set_some_booleans, 4, ALL & ~TERMINATED},
#endif
    {step, 24, STEPPING},
    {derivative, 4, ALL & ~INSTANTIATED},
    {output_derivative, 3, STEPPING},
    {set_time, 3, EXCHANGING | NO_STEPS},
    {set_states, 6, CONTINUOUS},
    {get_states, 6, EXCHANGING | NO_STEPS},
    {get_indicators, 1, EXCHANGING | NO_STEPS},
    {update_discrete_states, 3, EVENT},
    {change_mode, 4, EXCHANGING | (HAS_EVENT_MODE ? STEPPING : 0)},
    {complete_step, 3, CONTINUOUS},
    {save_some, 2, ALL},
    {restore_some, 2, ALL},
    {free_some, 1, ALL},
    {serialize, 1, ALL},
    {deserialize, 1, ALL},
    {other_type, 1, ALL},
    {unsupported, 1, ALL},
    {without_instance, 1, ALL},
    {destroy, 1, ALL},
#if FMI == 2
    {step_status, 2, STEPPING},
#endif
};

static size_t draw_call(void) {
    const size_t count = sizeof CALLS / sizeof CALLS[0];
    unsigned total = 0;
    for (size_t i = 0; i < count; i++) total += CALLS[i].weight;
    unsigned rest = below(total);
    size_t i = 0;
    while (rest >= CALLS[i].weight) rest -= CALLS[i++].weight;
    return i;
}

static void call_one(Slot *slot) {
    const size_t k = draw_call();
    const unsigned states = slot->exchange || !(CALLS[k].states & NO_STEPS) ? CALLS[k].states : 0;
    if (!(slot->now.state & states) && !once_in(100)) return;
    if (save(slot, &slot->before) != OK) fail("a state cannot be saved", slot, ERROR);
    const Known known = slot->now;
    const unsigned log_mask = slot->log_mask;
    slot->lines = 0;
    slot->inner_error = false;
    const Answer answer = CALLS[k].call(slot);
    if (answer.status == NOT_CALLED) return;
    call_count++;
    check(slot, answer, &known, log_mask);
}

static double now_in_seconds(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

int main(int count, char *arguments[]) {
    if (count != 3) return 3;
    seed = strtoull(arguments[1], NULL, 10);
    random_state = (seed + 1) * UINT64_C(11400714819323198485);
    const unsigned long long calls = strtoull(arguments[2], NULL, 10);
    while (strncmp(VARIABLES[attitude_reference].name, "attitude[", 9) != 0) attitude_reference++;
    signal(SIGALRM, hung);
    const double start = now_in_seconds();
    for (unsigned long long round = 0; call_count < calls; round++) {
        Slot *slot = &slots[below(SLOTS)];
        if (round % 4096 == 0) alarm(PATIENCE);
        if (slot->component) call_one(slot);
        else make_instance(slot);
    }
    for (size_t i = 0; i < SLOTS; i++) free_slot(&slots[i]);
    for (size_t i = 0; i < BLOBS; i++) free(blobs[i].bytes);
    const double duration = now_in_seconds() - start;
    printf("%llu calls in %.1f s, %.0f a second: %lu ok, %lu discarded, %lu errors; %lu steps taken; digest %016llx\n",
           call_count, duration, (double)call_count / duration, answered[OK], answered[DISCARD], answered[ERROR],
           steps_taken, (unsigned long long)digest);
    return 0;
}
