/* Flies one of several FMUs that are linked into one program. The compiler's command line gives FMI, the version, and
   FMI2_FUNCTION_PREFIX or FMI3_FUNCTION_PREFIX, by which the standard's header names the FMU's functions. */
#include <stddef.h>

#define JOIN_AS_WRITTEN(a, b) a##b
#define JOIN(a, b) JOIN_AS_WRITTEN(a, b)

#if FMI == 2
#include "fmi2Functions.h"
#define OURS(NAME) JOIN(FMI2_FUNCTION_PREFIX, pilot2_##NAME)
static fmi2Component it;
#else
#include "fmi3Functions.h"
#define OURS(NAME) JOIN(FMI3_FUNCTION_PREFIX, pilot3_##NAME)
static fmi3Instance it;
#endif

int OURS(begin)(const char *token, const unsigned references[], const double values[], size_t count);
int OURS(step)(double time, double h);
int OURS(read)(const unsigned references[], double values[], size_t count);

/* Each returns whether all went well. */
int OURS(begin)(const char *token, const unsigned references[], const double values[], size_t count) {
#if FMI == 2
    static const fmi2CallbackFunctions callbacks = {NULL, NULL, NULL, NULL, NULL};
    it = fmi2Instantiate("it", fmi2CoSimulation, token, "", &callbacks, fmi2False, fmi2False);
    return it && fmi2SetupExperiment(it, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK &&
           fmi2EnterInitializationMode(it) == fmi2OK && fmi2SetReal(it, references, count, values) == fmi2OK &&
           fmi2ExitInitializationMode(it) == fmi2OK;
#else
    it = fmi3InstantiateCoSimulation("it", token, NULL, fmi3False, fmi3False, fmi3False, fmi3False, NULL, 0, NULL, NULL,
                                     NULL);
    return it && fmi3EnterInitializationMode(it, fmi3False, 0.0, 0.0, fmi3False, 0.0) == fmi3OK &&
           fmi3SetFloat64(it, references, count, values, count) == fmi3OK && fmi3ExitInitializationMode(it) == fmi3OK;
#endif
}

int OURS(step)(double time, double h) {
#if FMI == 2
    return fmi2DoStep(it, time, h, fmi2True) == fmi2OK;
#else
    fmi3Boolean flags[3];
    double last;
    return fmi3DoStep(it, time, h, fmi3True, &flags[0], &flags[1], &flags[2], &last) == fmi3OK;
#endif
}

int OURS(read)(const unsigned references[], double values[], size_t count) {
#if FMI == 2
    return fmi2GetReal(it, references, count, values) == fmi2OK;
#else
    return fmi3GetFloat64(it, references, count, values, count) == fmi3OK;
#endif
}
