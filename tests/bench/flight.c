/* Loads the library of an FMI 3.0 co-simulation FMU and times a whole flight from the scene's start, outputs got after
   each communication step, beside a plain RK4 step.

   flight LIBRARY TOKEN SIZE COUNT TOLERANCE SET_COUNT REFERENCE VALUE ... GET_COUNT REFERENCE ...
   Prints "nanoseconds ratio" of the flight, medians over rounds, then the values got at its end; "discarded" where
   the FMU refuses a step. */
#include "library.h"
#include "plain.h"

enum { ROUNDS = 15, MOST = 64, PLAIN_STEPS = 5000 };

static const double SHORTEST_ROUND = 2e-3; /* s */

typedef struct {
    fmi3Instance instance;
    fmi3DoStepTYPE *do_step;
    fmi3GetFloat64TYPE *get;
    fmi3SetFMUStateTYPE *restore;
    fmi3FMUState start;
    double size, values[MOST];
    long count;
    fmi3ValueReference got[MOST];
    size_t get_count;
} Flight;

static bool fly(Flight *f) {
    fmi3Boolean event, terminate, early;
    double last = 0.0;
    check(f->restore(f->instance, f->start), "restore");
    for (long i = 0; i < f->count; i++) {
        const fmi3Status status = f->do_step(f->instance, last, f->size, true, &event, &terminate, &early, &last);
        if (status == fmi3Discard) return false;
        check(status, "step");
        check(f->get(f->instance, f->got, f->get_count, f->values, f->get_count), "get");
    }
    return true;
}

int main(int count, char **words) {
    if (count < 8) return 2;
    void *library = load(words[1]);
    fmi3InstantiateCoSimulationTYPE *instantiate = look_up(library, "fmi3InstantiateCoSimulation");
    fmi3EnterInitializationModeTYPE *enter = look_up(library, "fmi3EnterInitializationMode");
    fmi3ExitInitializationModeTYPE *leave = look_up(library, "fmi3ExitInitializationMode");
    fmi3SetFloat64TYPE *set = look_up(library, "fmi3SetFloat64");
    fmi3GetFMUStateTYPE *save = look_up(library, "fmi3GetFMUState");
    static Flight f;
    f.do_step = look_up(library, "fmi3DoStep");
    f.get = look_up(library, "fmi3GetFloat64");
    f.restore = look_up(library, "fmi3SetFMUState");
    f.size = strtod(words[3], NULL);
    f.count = strtol(words[4], NULL, 10);
    const double tolerance = strtod(words[5], NULL);
    f.instance = instantiate("timed", words[2], NULL, false, false, false, false, NULL, 0, NULL, NULL, NULL);
    if (!f.instance) return 1;
    check(enter(f.instance, tolerance > 0.0, tolerance, 0.0, false, 0.0), "enter");
    check(leave(f.instance), "leave");
    char **word = words + 6;
    for (long n = strtol(*word++, NULL, 10); n > 0; n--) {
        const fmi3ValueReference reference = (fmi3ValueReference)strtoul(*word++, NULL, 10);
        const double value = strtod(*word++, NULL);
        check(set(f.instance, &reference, 1, &value, 1), "set");
    }
    f.get_count = (size_t)strtoul(*word++, NULL, 10);
    for (size_t i = 0; i < f.get_count && i < MOST; i++) f.got[i] = (fmi3ValueReference)strtoul(*word++, NULL, 10);
    check(f.get(f.instance, f.got, f.get_count, f.values, f.get_count), "get");
    check(save(f.instance, &f.start), "save");
    double sink = 0.0, begun = now();
    if (!fly(&f)) {
        printf("discarded\n");
        return 0;
    }
    const double once = now() - begun;
    const long repeats = once < SHORTEST_ROUND ? (long)(SHORTEST_ROUND / (once + 1e-9)) + 1 : 1;
    static double taken[ROUNDS], ratio[ROUNDS];
    for (int round = 0; round < ROUNDS; round++) {
        const double plain = time_plain(PLAIN_STEPS, &sink);
        begun = now();
        for (long i = 0; i < repeats; i++) fly(&f);
        taken[round] = 1e9 * (now() - begun) / (double)repeats;
        ratio[round] = taken[round] / plain;
    }
    printf("%.2f %.4f", median(taken, ROUNDS), median(ratio, ROUNDS));
    for (size_t i = 0; i < f.get_count; i++) printf(" %.17g", f.values[i]);
    printf("\n");
    return isfinite(sink) ? 0 : 1;
}
