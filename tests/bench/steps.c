/* Loads the library of an FMI 3.0 co-simulation FMU and times one communication step from the scene's start, again
   and again from a saved state, beside a plain RK4 step.

   steps LIBRARY TOKEN SIZE REPEATS TOLERANCE SET_COUNT REFERENCE VALUE ... GET_COUNT REFERENCE ...
   Prints "nanoseconds ratio" of the step without the restoring, least of short rounds of one and the other by turns,
   which is what other work on the machine disturbs least, then the values got after one step. */
#include "library.h"
#include "plain.h"

enum { ROUNDS = 3000, MOST = 64, PLAIN_STEPS = 1000 };

/* Initialises the instance and sets what the words say: SET_COUNT REFERENCE VALUE ... Returns the word after them. */
static char **start_flight(void *library, fmi3Instance f, double tolerance, char **word) {
    fmi3EnterInitializationModeTYPE *enter = look_up(library, "fmi3EnterInitializationMode");
    fmi3ExitInitializationModeTYPE *leave = look_up(library, "fmi3ExitInitializationMode");
    fmi3SetFloat64TYPE *set_values = look_up(library, "fmi3SetFloat64");
    check(enter(f, tolerance > 0.0, tolerance, 0.0, false, 0.0), "enter");
    check(leave(f), "leave");
    for (long n = strtol(*word++, NULL, 10); n > 0; n--) {
        const fmi3ValueReference reference = (fmi3ValueReference)strtoul(*word++, NULL, 10);
        const double value = strtod(*word++, NULL);
        check(set_values(f, &reference, 1, &value, 1), "set");
    }
    return word;
}

int main(int count, char **words) {
    if (count < 8) return 2;
    void *library = load(words[1]);
    fmi3InstantiateCoSimulationTYPE *instantiate = look_up(library, "fmi3InstantiateCoSimulation");
    fmi3GetFloat64TYPE *get_values = look_up(library, "fmi3GetFloat64");
    fmi3DoStepTYPE *do_step = look_up(library, "fmi3DoStep");
    fmi3GetFMUStateTYPE *save = look_up(library, "fmi3GetFMUState");
    fmi3SetFMUStateTYPE *restore = look_up(library, "fmi3SetFMUState");
    const double size = strtod(words[3], NULL), tolerance = strtod(words[5], NULL);
    const long repeats = strtol(words[4], NULL, 10);
    fmi3Instance f = instantiate("timed", words[2], NULL, false, true, false, false, NULL, 0, NULL, log_message, NULL);
    if (!f) return 1;
    char **word = start_flight(library, f, tolerance, words + 6);
    fmi3Boolean event, terminate, early;
    double last, sink = 0.0, values[MOST];
    fmi3FMUState start = NULL;
    double restoring = INFINITY, taken = INFINITY, plain = INFINITY;
    check(do_step(f, 0.0, size, true, &event, &terminate, &early, &last), "step");
    fmi3ValueReference got[MOST];
    const size_t get_count = (size_t)strtoul(*word++, NULL, 10);
    for (size_t i = 0; i < get_count && i < MOST; i++) got[i] = (fmi3ValueReference)strtoul(*word++, NULL, 10);
    check(get_values(f, got, get_count, values, get_count), "get");
    /* The state to come back to is one at time 0 whose principal axes have been found. */
    fmi3ResetTYPE *reset = look_up(library, "fmi3Reset");
    check(reset(f), "reset");
    start_flight(library, f, tolerance, words + 6);
    double all[MOST];
    check(get_values(f, got, get_count, all, get_count), "get");
    check(save(f, &start), "save");
    for (int round = 0; round < ROUNDS; round++) {
        plain = fmin(plain, time_plain(PLAIN_STEPS, &sink));
        double begun = now();
        for (long i = 0; i < repeats; i++) check(restore(f, start), "restore");
        restoring = fmin(restoring, now() - begun);
        begun = now();
        for (long i = 0; i < repeats; i++) {
            check(restore(f, start), "restore");
            check(do_step(f, 0.0, size, true, &event, &terminate, &early, &last), "step");
        }
        taken = fmin(taken, now() - begun);
    }
    const double each = 1e9 * (taken - restoring) / (double)repeats;
    printf("%.2f %.3f", each, each / plain);
    for (size_t i = 0; i < get_count; i++) printf(" %.17g", values[i]);
    printf("\n");
    return isfinite(sink) ? 0 : 1;
}
