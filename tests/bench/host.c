/* Loads the library of an FMI 3.0 co-simulation FMU and times its steps from native code, beside a plain RK4 step.

   host LIBRARY TOKEN STEPS SET_COUNT SET_REFERENCE ... GET_COUNT GET_REFERENCE ...
   Sets the given inputs to slowly changing values around their start values, steps by 1 ms, gets the given outputs.
   Prints lines "name nanoseconds ratio": the median over short rounds, each of which times the plain step as well;
   the ratio is to that. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "library.h"
#include "plain.h"

enum { MOST = 4096, ROUNDS = 201 };

static const double STEP_SIZE = 1e-3;

static fmi3SetFloat64TYPE *set_values;
static fmi3GetFloat64TYPE *get_values;
static fmi3DoStepTYPE *do_step;

typedef struct {
    fmi3Instance instance;
    fmi3ValueReference set[MOST], get[MOST];
    double start[MOST], set_to[MOST], got[MOST];
    size_t set_count, get_count;
    double time;
} Flight;

typedef enum { SET = 1, STEP = 2, GET = 4 } Part;

static double time_flight(Flight *f, long steps, unsigned parts, double change) {
    fmi3Boolean event, terminate, early;
    double last;
    const double start = now();
    for (long i = 0; i < steps; i++) {
        if (parts & SET) {
            const double factor = 1.0 + change * (double)(i + 1);
            for (size_t k = 0; k < f->set_count; k++) f->set_to[k] = f->start[k] * factor;
            check(set_values(f->instance, f->set, f->set_count, f->set_to, f->set_count), "set");
        }
        if (parts & STEP) {
            check(do_step(f->instance, f->time, STEP_SIZE, true, &event, &terminate, &early, &last), "step");
            f->time = last;
        }
        if (parts & GET) check(get_values(f->instance, f->get, f->get_count, f->got, f->get_count), "get");
    }
    return 1e9 * (now() - start) / (double)steps;
}

static size_t read_references(char **words, fmi3ValueReference references[MOST]) {
    const size_t count = (size_t)strtoul(words[0], NULL, 10);
    for (size_t i = 0; i < count && i < MOST; i++)
        references[i] = (fmi3ValueReference)strtoul(words[i + 1], NULL, 10);
    return count;
}

int main(int count, char **words) {
    if (count < 6) return 2;
    void *library = load(words[1]);
    fmi3InstantiateCoSimulationTYPE *instantiate = look_up(library, "fmi3InstantiateCoSimulation");
    fmi3EnterInitializationModeTYPE *enter = look_up(library, "fmi3EnterInitializationMode");
    fmi3ExitInitializationModeTYPE *leave = look_up(library, "fmi3ExitInitializationMode");
    set_values = look_up(library, "fmi3SetFloat64");
    get_values = look_up(library, "fmi3GetFloat64");
    do_step = look_up(library, "fmi3DoStep");
    static Flight f;
    const long steps = strtol(words[3], NULL, 10);
    f.set_count = read_references(words + 4, f.set);
    f.get_count = read_references(words + 5 + f.set_count, f.get);
    f.instance =
        instantiate("timed", words[2], NULL, false, false, false, false, NULL, 0, NULL, NULL, NULL);
    if (!f.instance) return 1;
    check(enter(f.instance, false, 0.0, 0.0, false, 0.0), "enter");
    check(leave(f.instance), "leave");
    check(get_values(f.instance, f.set, f.set_count, f.start, f.set_count), "start");
    const struct {
        const char *name;
        unsigned parts;
        double change;
    } cases[] = {
        {"set+step+get", SET | STEP | GET, 0.0},
        {"set+step+get,changing", SET | STEP | GET, 1e-9},
        {"step", STEP, 0.0},
        {"step+get", STEP | GET, 0.0},
        {"get", GET, 0.0},
        {"set", SET, 0.0},
    };
    enum { CASES = sizeof cases / sizeof cases[0] };
    static double taken[CASES + 1][ROUNDS], ratio[CASES + 1][ROUNDS];
    double sink = 0.0;
    for (int round = 0; round < ROUNDS; round++)
        for (int k = 0; k < CASES; k++) {
            const double plain = time_plain(steps, &sink);
            taken[CASES][round] = plain;
            taken[k][round] = time_flight(&f, steps, cases[k].parts, cases[k].change);
            ratio[k][round] = taken[k][round] / plain;
        }
    printf("plain %.2f 1\n", median(taken[CASES], ROUNDS));
    for (int k = 0; k < CASES; k++) printf("%s %.2f %.3f\n", cases[k].name, median(taken[k], ROUNDS), median(ratio[k], ROUNDS));
    return isfinite(sink) ? 0 : 1;
}
