/* Flies an FMU whose sources are linked in and were compiled so that malloc, calloc and realloc are counted. Prints how
   many calls instantiation made, and how many came after it: from sets, steps, gets, derivatives, refusals and resets. */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

#include "fmi3Functions.h"
#include "scene.h"

void *counted_malloc(size_t size);
void *counted_calloc(size_t count, size_t size);
void *counted_realloc(void *block, size_t size);

static unsigned long calls;

void *counted_malloc(size_t size) {
    calls++;
    return malloc(size);
}

void *counted_calloc(size_t count, size_t size) {
    calls++;
    return calloc(count, size);
}

void *counted_realloc(void *block, size_t size) {
    calls++;
    return realloc(block, size);
}

static void must(bool right, const char *what) {
    if (right) return;
    fprintf(stderr, "%s\n", what);
    exit(1);
}

static void logged(fmi3InstanceEnvironment lines, fmi3Status status, fmi3String category, fmi3String message) {
    (void)status, (void)category, (void)message;
    ++*(unsigned long *)lines;
}

static void start(fmi3Instance instance) {
    must(fmi3EnterInitializationMode(instance, false, 0.0, 0.0, false, 0.0) == fmi3OK, "enter");
    must(fmi3ExitInitializationMode(instance) == fmi3OK, "exit");
}

int main(int count, char **words) {
    unsigned long lines = 0;
    must(count == 2, "host TOKEN");
    fmi3Instance instance = fmi3InstantiateCoSimulation("counted", words[1], NULL, false, true, false, false, NULL, 0,
                                                        &lines, logged, NULL);
    must(instance != NULL, "instantiate");
    const unsigned long at_first = calls;
    const fmi3ValueReference mass = REFERENCE_P, torque = REFERENCE_TORQUE, rate = REFERENCE_STATES + 4;
    for (int flight = 0; flight < 3; flight++) {
        start(instance);
        double kilograms, time = 0.0;
        must(fmi3GetFloat64(instance, &mass, 1, &kilograms, 1) == fmi3OK, "get");
        for (int i = 0; i < 1000; i++) {
            fmi3Boolean event, terminate, early;
            const double bad = -1.0, none = NAN, lighter = kilograms * (1.0 - 1e-4 * i), moment = 100.0 * i;
            double value, sensitivity;
            if (i % 10 == 0) {
                must(fmi3SetFloat64(instance, &torque, 1, &none, 1) == fmi3Discard, "a torque of NaN");
                must(fmi3SetFloat64(instance, &mass, 1, &bad, 1) == fmi3OK, "set");
                must(fmi3DoStep(instance, time, 0.1, true, &event, &terminate, &early, &value) == fmi3Discard,
                     "a step with a negative mass");
            }
            must(fmi3SetFloat64(instance, &mass, 1, &lighter, 1) == fmi3OK, "set");
            must(fmi3SetFloat64(instance, &torque, 1, &moment, 1) == fmi3OK, "set");
            must(fmi3DoStep(instance, time, 0.1, true, &event, &terminate, &early, &time) == fmi3OK, "step");
            for (unsigned k = 0; k < OUTPUT_COUNT; k++) {
                const fmi3ValueReference output = REFERENCE_OUTPUTS + k;
                const fmi3Int32 order = 1;
                must(fmi3GetFloat64(instance, &output, 1, &value, 1) == fmi3OK, "get");
                must(fmi3GetOutputDerivatives(instance, &output, 1, &order, &value, 1) == fmi3OK, "output derivative");
            }
            const fmi3ValueReference change = REFERENCE_DERIVATIVES + 4;
            const double seed = 1.0;
            must(fmi3GetDirectionalDerivative(instance, &change, 1, &mass, 1, &seed, 1, &sensitivity, 1) == fmi3OK,
                 "directional derivative");
            must(fmi3GetAdjointDerivative(instance, &change, 1, &torque, 1, &seed, 1, &sensitivity, 1) == fmi3OK,
                 "adjoint derivative");
            must(fmi3GetFloat64(instance, &rate, 1, &value, 1) == fmi3OK, "get");
        }
        must(fmi3Reset(instance) == fmi3OK, "reset");
    }
    must(lines >= 600, "refusals are logged");
    printf("%lu %lu\n", at_first, calls - at_first);
    fmi3FreeInstance(instance);
    return 0;
}
