/* What the fuzzer knows as an importer: of each instance, of saved states, of the calls so far; and how a broken rule
   ends the program. */
#ifndef FUZZ_INSTANCES_H
#define FUZZ_INSTANCES_H

#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

#endif
