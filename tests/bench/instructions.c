/* Loads the library of an FMI 3.0 co-simulation FMU and goes through steps of 0.1 s, for a program that counts
   instructions.

   instructions LIBRARY TOKEN PARTS CHANGE STEPS SET_COUNT REFERENCE ... GET_COUNT REFERENCE ...
   PARTS: 1 sets the given inputs, 2 steps, 4 gets the given outputs; their sum does several in this order. Before each
   step the inputs are set to their start values, enlarged by the share CHANGE times the number of the step. */
#include "library.h"

enum { SET = 1, STEP = 2, GET = 4 };

static const double STEP_SIZE = 0.1; /* s */

typedef struct {
    fmi3ValueReference *references;
    double *values;
    size_t count;
} Variables;

static Variables read_variables(char ***word) {
    const size_t count = (size_t)strtoul(*(*word)++, NULL, 10);
    Variables read = {calloc(count + 1, sizeof *read.references), calloc(count + 1, sizeof *read.values), count};
    if (!read.references || !read.values) exit(1);
    for (size_t i = 0; i < count; i++) read.references[i] = (fmi3ValueReference)strtoul(*(*word)++, NULL, 10);
    return read;
}

int main(int count, char **words) {
    if (count < 8) return 2;
    void *library = load(words[1]);
    fmi3InstantiateCoSimulationTYPE *instantiate = look_up(library, "fmi3InstantiateCoSimulation");
    fmi3EnterInitializationModeTYPE *enter = look_up(library, "fmi3EnterInitializationMode");
    fmi3ExitInitializationModeTYPE *leave = look_up(library, "fmi3ExitInitializationMode");
    fmi3SetFloat64TYPE *set_values = look_up(library, "fmi3SetFloat64");
    fmi3GetFloat64TYPE *get_values = look_up(library, "fmi3GetFloat64");
    fmi3DoStepTYPE *do_step = look_up(library, "fmi3DoStep");
    const unsigned long parts = strtoul(words[3], NULL, 10);
    const double change = strtod(words[4], NULL);
    const long steps = strtol(words[5], NULL, 10);
    char **word = words + 6;
    Variables set = read_variables(&word), got = read_variables(&word);
    double *start = calloc(set.count + 1, sizeof *start);
    fmi3Instance f =
        instantiate("counted", words[2], NULL, false, true, false, false, NULL, 0, NULL, log_message, NULL);
    if (!f || !start) return 1;
    check(enter(f, false, 0.0, 0.0, false, 0.0), "enter");
    check(leave(f), "leave");
    check(get_values(f, set.references, set.count, start, set.count), "start");
    double time = 0.0;
    for (long n = 1; n <= steps; n++) {
        fmi3Boolean event, terminate, early;
        for (size_t i = 0; i < set.count; i++) set.values[i] = start[i] * (1.0 + change * (double)n);
        if (parts & SET) check(set_values(f, set.references, set.count, set.values, set.count), "set");
        if (parts & STEP) check(do_step(f, time, STEP_SIZE, true, &event, &terminate, &early, &time), "step");
        if (parts & GET) check(get_values(f, got.references, got.count, got.values, got.count), "get");
    }
    return 0;
}
