/* Loads the library of an FMI 3.0 co-simulation FMU and flies it by a script; runs on Linux, macOS and Windows.

   host LIBRARY TOKEN < SCRIPT
   Lines of the script: set REFERENCE VALUE, exit (initialisation), step VALUE, get REFERENCE. Values are the 16
   hexadecimal digits of a double's bits, so that no platform's reading or printing of numbers can matter; each get
   prints a line with one. Any status but fmi3OK ends the program with exit status 1 and a line on stderr. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "library.h"

static double to_double(uint64_t bits) {
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static uint64_t to_bits(double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static void fly(void *library, fmi3Instance instance) {
    fmi3SetFloat64TYPE *set = (fmi3SetFloat64TYPE *)look_up(library, "fmi3SetFloat64");
    fmi3GetFloat64TYPE *get = (fmi3GetFloat64TYPE *)look_up(library, "fmi3GetFloat64");
    fmi3DoStepTYPE *step = (fmi3DoStepTYPE *)look_up(library, "fmi3DoStep");
    fmi3ExitInitializationModeTYPE *leave =
        (fmi3ExitInitializationModeTYPE *)look_up(library, "fmi3ExitInitializationMode");
    double time = 0.0;
    char line[128], word[16];
    while (fgets(line, sizeof line, stdin)) {
        fmi3ValueReference reference = 0;
        uint64_t bits = 0;
        fmi3Float64 value;
        sscanf(line, "%15s", word);
        if (strcmp(word, "set") == 0 && sscanf(line, "%*s %" SCNu32 " %" SCNx64, &reference, &bits) == 2) {
            value = to_double(bits);
            check(set(instance, &reference, 1, &value, 1), line);
        } else if (strcmp(word, "get") == 0 && sscanf(line, "%*s %" SCNu32, &reference) == 1) {
            check(get(instance, &reference, 1, &value, 1), line);
            printf("%016" PRIx64 "\n", to_bits(value));
        } else if (strcmp(word, "step") == 0 && sscanf(line, "%*s %" SCNx64, &bits) == 1) {
            fmi3Boolean event, end, early;
            check(step(instance, time, to_double(bits), fmi3True, &event, &end, &early, &time), line);
        } else if (strcmp(word, "exit") == 0) {
            check(leave(instance), line);
        } else {
            fprintf(stderr, "not understood: %s\n", line);
            exit(1);
        }
    }
}

int main(int count, char **arguments) {
    if (count != 3) {
        fprintf(stderr, "usage: host LIBRARY TOKEN < SCRIPT\n");
        return 2;
    }
    void *library = load(arguments[1]);
    fmi3InstantiateCoSimulationTYPE *instantiate =
        (fmi3InstantiateCoSimulationTYPE *)look_up(library, "fmi3InstantiateCoSimulation");
    fmi3EnterInitializationModeTYPE *enter =
        (fmi3EnterInitializationModeTYPE *)look_up(library, "fmi3EnterInitializationMode");
    fmi3TerminateTYPE *terminate = (fmi3TerminateTYPE *)look_up(library, "fmi3Terminate");
    fmi3FreeInstanceTYPE *release = (fmi3FreeInstanceTYPE *)look_up(library, "fmi3FreeInstance");
    fmi3Instance instance = instantiate("host", arguments[2], NULL, fmi3False, fmi3True, fmi3False, fmi3False, NULL, 0,
                                        NULL, log_message, NULL);
    if (!instance) return 1;
    check(enter(instance, fmi3False, 0.0, 0.0, fmi3False, 0.0), "fmi3EnterInitializationMode");
    fly(library, instance);
    check(terminate(instance), "fmi3Terminate");
    release(instance);
    return 0;
}
