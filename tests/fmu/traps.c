/* Flies the library of an FMI 3.0 FMU with floating-point exceptions trapped, as some hosts have them: an invalid
   operation, a division by zero or an overflow ends this program by SIGFPE.

   traps LIBRARY TOKEN STEPS STEP RATE-REFERENCE WX WY WZ */
#define _GNU_SOURCE
#include <fenv.h>

#include "library.h"

#define LOOK_UP(name) name##TYPE *name = (name##TYPE *)look_up(library, #name)

int main(int count, char **words) {
    if (count != 9) return 2;
    void *library = load(words[1]);
    LOOK_UP(fmi3InstantiateCoSimulation);
    LOOK_UP(fmi3EnterInitializationMode);
    LOOK_UP(fmi3ExitInitializationMode);
    LOOK_UP(fmi3SetFloat64);
    LOOK_UP(fmi3GetFloat64);
    LOOK_UP(fmi3DoStep);
    LOOK_UP(fmi3Reset);
    LOOK_UP(fmi3FreeInstance);
    const unsigned long steps = strtoul(words[3], NULL, 10);
    const double step = strtod(words[4], NULL);
    const fmi3ValueReference first = (fmi3ValueReference)strtoul(words[5], NULL, 10);
    const fmi3ValueReference rates[3] = {first, first + 1, first + 2};
    const double start[3] = {strtod(words[6], NULL), strtod(words[7], NULL), strtod(words[8], NULL)};
    feenableexcept(FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW);
    fmi3Instance instance = fmi3InstantiateCoSimulation("trapped", words[2], NULL, fmi3False, fmi3False, fmi3False,
                                                        fmi3False, NULL, 0, NULL, log_message, NULL);
    if (!instance) return 1;
    for (int flight = 0; flight < 2; flight++) {
        double time = 0.0, read[3];
        check(fmi3EnterInitializationMode(instance, fmi3False, 0.0, 0.0, fmi3False, 0.0), "enter");
        check(fmi3SetFloat64(instance, rates, 3, start, 3), "set");
        check(fmi3ExitInitializationMode(instance), "exit");
        for (unsigned long i = 0; i < steps; i++) {
            fmi3Boolean event, terminate, early;
            double last;
            check(fmi3DoStep(instance, time, step, fmi3True, &event, &terminate, &early, &last), "step");
            time += step;
            check(fmi3GetFloat64(instance, rates, 3, read, 3), "get");
        }
        check(fmi3Reset(instance), "reset");
    }
    fmi3FreeInstance(instance);
    return 0;
}
