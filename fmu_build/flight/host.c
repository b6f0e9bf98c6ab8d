/* Flies the library of an FMI 3.0 co-simulation FMU through an experiment, and times that beside a plain RK4 step.
   Built as a shared library, with SHOWN and MESSAGE_SIZE of host.py, which loads it and the FMU's and hands the FMU's
   functions over. */
#ifndef _WIN32
#define _POSIX_C_SOURCE 200112L
#endif
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi3FunctionTypes.h"

#ifdef _WIN32
#include <windows.h>
#define VISIBLE __declspec(dllexport)
#else
#define VISIBLE __attribute__((visibility("default")))
#endif

enum { CHUNKS = 64, LEAST_ROUNDS = 3, MOST_ROUNDS = 200, PLAIN_STEPS = 2000 };

/* As ctypes lays them out in host.py. */
typedef struct {
    fmi3InstantiateCoSimulationTYPE *instantiate;
    fmi3EnterInitializationModeTYPE *enter;
    fmi3ExitInitializationModeTYPE *leave;
    fmi3SetFloat64TYPE *set_numbers;
    fmi3SetBooleanTYPE *set_booleans;
    fmi3GetFloat64TYPE *get;
    fmi3DoStepTYPE *step;
    fmi3FreeInstanceTYPE *release;
} Functions;

typedef struct {
    const char *token;
    double tolerance; /* 0: the scene's */
    double size, last_size; /* s */
    long long steps;
    long long number_count, boolean_count; /* of inputs that move */
    const fmi3ValueReference *number_references, *boolean_references, *shown;
    long long field_count; /* of inputs that say where the body is in a field of gravity */
    const fmi3ValueReference *field_references;
    const double *field; /* steps x field_count: set before every step */
    long long row_count;
    const long long *rows;       /* numbers of the steps before which inputs are set, ascending, from 0 */
    const double *numbers;       /* row_count x number_count */
    const fmi3Boolean *booleans; /* row_count x boolean_count */
    long long sample_count;
    const long long *sampled; /* numbers of steps, ascending, from 1 */
    double seconds;           /* for timing; three rounds may take ten times as long; 0: no timing */
} Flight;

typedef struct {
    double nanoseconds, ratio; /* of a step: inputs set, step, attitude and rate got; over a plain RK4 step */
    long long sub_steps;
    double failed_at; /* s, where a call did not succeed */
    char message[MESSAGE_SIZE];
} Report;

/* Time [s] that this thread has had of a core, so that others who want it do not count; on Windows, time. */
static double seconds_now(void) {
#ifdef _WIN32
    LARGE_INTEGER count, frequency;
    QueryPerformanceCounter(&count);
    QueryPerformanceFrequency(&frequency);
    return (double)count.QuadPart / (double)frequency.QuadPart;
#else
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
#endif
}

static double smaller(double a, double b) {
    return a < b ? a : b;
}

/* What asking for the time takes. */
static double seconds_of_clock(void) {
    double least = 1.0;
    for (int i = 0; i < 1000; i++) {
        const double start = seconds_now();
        least = smaller(least, seconds_now() - start);
    }
    return least;
}

/* A step of attitude and rate under a full tensor as one would write it by hand: the unit of cost. */

static const double TENSOR[3][3] = {{2.0, 0.1, 0.2}, {0.1, 3.0, 0.3}, {0.2, 0.3, 4.0}};
static const double INVERSE[3][3] = {{0.51, -0.02, -0.02}, {-0.02, 0.34, -0.02}, {-0.02, -0.02, 0.26}};

static void plain_rate(const double x[SHOWN], const double torque[3], double rate[SHOWN]) {
    const double *w = x + 4;
    double L[3], right[3];
    for (int i = 0; i < 3; i++) L[i] = TENSOR[i][0] * w[0] + TENSOR[i][1] * w[1] + TENSOR[i][2] * w[2];
    right[0] = torque[0] - (w[1] * L[2] - w[2] * L[1]);
    right[1] = torque[1] - (w[2] * L[0] - w[0] * L[2]);
    right[2] = torque[2] - (w[0] * L[1] - w[1] * L[0]);
    for (int i = 0; i < 3; i++)
        rate[4 + i] = INVERSE[i][0] * right[0] + INVERSE[i][1] * right[1] + INVERSE[i][2] * right[2];
    rate[0] = -0.5 * (x[1] * w[0] + x[2] * w[1] + x[3] * w[2]);
    rate[1] = 0.5 * (x[0] * w[0] + x[2] * w[2] - x[3] * w[1]);
    rate[2] = 0.5 * (x[0] * w[1] + x[3] * w[0] - x[1] * w[2]);
    rate[3] = 0.5 * (x[0] * w[2] + x[1] * w[1] - x[2] * w[0]);
}

static double plain_seconds(double *sink) {
    const double h = 1e-3;
    double x[SHOWN] = {1.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3}, torque[3] = {0.0, 0.0, 0.0};
    const double start = seconds_now();
    for (int n = 0; n < PLAIN_STEPS; n++) {
        double k[4][SHOWN], y[SHOWN], square = 0.0;
        torque[0] = 1e-9 * n;
        plain_rate(x, torque, k[0]);
        for (int s = 1; s < 4; s++) {
            const double part = s < 3 ? 0.5 * h : h;
            for (int i = 0; i < SHOWN; i++) y[i] = x[i] + part * k[s - 1][i];
            plain_rate(y, torque, k[s]);
        }
        for (int i = 0; i < SHOWN; i++) x[i] += h / 6.0 * (k[0][i] + 2.0 * (k[1][i] + k[2][i]) + k[3][i]);
        for (int i = 0; i < 4; i++) square += x[i] * x[i];
        const double scale = 1.0 / sqrt(square);
        for (int i = 0; i < 4; i++) x[i] *= scale;
    }
    const double taken = seconds_now() - start;
    *sink += x[0] + x[4];
    return taken / (double)PLAIN_STEPS;
}

static void note(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message) {
    (void)category;
    if (status != fmi3OK) snprintf(((Report *)environment)->message, MESSAGE_SIZE, "%s", message);
}

static void count_sub_step(fmi3InstanceEnvironment environment, double time, bool set, bool get, bool finished,
                           bool may_return, bool *returns, double *return_time) {
    (void)time, (void)set, (void)get, (void)may_return, (void)return_time;
    if (finished) ((Report *)environment)->sub_steps++;
    *returns = false;
}

static bool set_inputs(const Functions *fmu, fmi3Instance f, const Flight *flight, long long row) {
    const size_t n = (size_t)flight->number_count, b = (size_t)flight->boolean_count;
    fmi3Status status = fmi3OK;
    if (b) status = fmu->set_booleans(f, flight->boolean_references, b, flight->booleans + (size_t)row * b, b);
    if (n && status == fmi3OK)
        status = fmu->set_numbers(f, flight->number_references, n, flight->numbers + (size_t)row * n, n);
    return status == fmi3OK;
}

static bool set_field(const Functions *fmu, fmi3Instance f, const Flight *flight, long long step) {
    const size_t n = (size_t)flight->field_count;
    return !n || fmu->set_numbers(f, flight->field_references, n, flight->field + (size_t)step * n, n) == fmi3OK;
}

/* Returns an instance at the start with a row's inputs, NULL if there is none. */
static fmi3Instance begin(const Functions *fmu, const Flight *flight, Report *report, bool watched, long long row) {
    fmi3Instance f = fmu->instantiate("trade", flight->token, NULL, false, watched, false, false, NULL, 0, report,
                                      note, watched ? count_sub_step : NULL);
    if (!f) return NULL;
    if (fmu->enter(f, flight->tolerance > 0.0, flight->tolerance, 0.0, false, 0.0) == fmi3OK &&
        set_inputs(fmu, f, flight, row) && set_field(fmu, f, flight, 0) && fmu->leave(f) == fmi3OK)
        return f;
    fmu->release(f);
    return NULL;
}

/* Flies the whole in chunks. Keeps samples, sample_count x SHOWN, where wanted, and the least time [s] that each
   chunk has taken. Whether every call succeeded. */
static bool fly(const Functions *fmu, fmi3Instance f, const Flight *flight, Report *report, double *samples,
                double least[CHUNKS]) {
    bool event, terminate, early;
    double time = 0.0, shown[SHOWN];
    long long next = 0, row = 0, i = 0;
    for (int chunk = 0; chunk < CHUNKS; chunk++) {
        const long long end = flight->steps * (chunk + 1) / CHUNKS;
        const double start = seconds_now();
        for (; i < end; i++) {
            const double size = i + 1 < flight->steps ? flight->size : flight->last_size;
            report->failed_at = time;
            if (row < flight->row_count && flight->rows[row] == i && !set_inputs(fmu, f, flight, row++)) return false;
            if (!set_field(fmu, f, flight, i)) return false;
            if (fmu->step(f, time, size, true, &event, &terminate, &early, &time) != fmi3OK) return false;
            if (fmu->get(f, flight->shown, SHOWN, shown, SHOWN) != fmi3OK) return false;
            if (samples && next < flight->sample_count && flight->sampled[next] == i + 1)
                memcpy(samples + SHOWN * next++, shown, sizeof shown);
        }
        least[chunk] = smaller(least[chunk], seconds_now() - start);
    }
    return true;
}

/* Flies once to look, then as often as there is time for, for the clock: of each chunk, and of the plain step, the
   least time counts, which nobody has disturbed. Returns 0 where every call succeeded. */
VISIBLE int trade_fly(const Functions *fmu, const Flight *flight, Report *report, double *samples) {
    double least[CHUNKS], plain = 1.0, sink = 0.0, taken = 0.0;
    for (int chunk = 0; chunk < CHUNKS; chunk++) least[chunk] = HUGE_VAL;
    memset(report, 0, sizeof *report);
    fmi3Instance f = begin(fmu, flight, report, true, 0);
    if (!f) return 1;
    const bool arrived = fly(fmu, f, flight, report, samples, least);
    fmu->release(f);
    if (!arrived) return 1;
    if (!(flight->seconds > 0.0)) return 0;
    for (int chunk = 0; chunk < CHUNKS; chunk++) least[chunk] = HUGE_VAL;
    const double begun = seconds_now(), clock = seconds_of_clock();
    for (int round = 0; round < MOST_ROUNDS; round++) {
        const double spent = seconds_now() - begun;
        if (spent > flight->seconds && (round >= LEAST_ROUNDS || spent > 10.0 * flight->seconds)) break;
        plain = smaller(plain, plain_seconds(&sink));
        f = begin(fmu, flight, report, false, 0);
        if (!f) return 1;
        const bool again = fly(fmu, f, flight, report, NULL, least);
        fmu->release(f);
        if (!again) return 1;
    }
    for (int chunk = 0; chunk < CHUNKS; chunk++) {
        const bool empty = flight->steps * (chunk + 1) / CHUNKS == flight->steps * chunk / CHUNKS;
        taken += empty ? 0.0 : least[chunk] - clock;
    }
    report->nanoseconds = 1e9 * taken / (double)flight->steps;
    report->ratio = taken / (double)flight->steps / plain;
    return isfinite(sink) ? 0 : 1;
}

/* Whether an instance can start with each row's inputs, 1 or 0. */
VISIBLE void trade_judge(const Functions *fmu, const Flight *flight, unsigned char *usable) {
    Report report;
    for (long long row = 0; row < flight->row_count; row++) {
        fmi3Instance f = begin(fmu, flight, &report, false, row);
        usable[row] = f != NULL;
        if (f) fmu->release(f);
    }
}
