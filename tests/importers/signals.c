/* An FMU for FMI 2.0 co-simulation whose outputs follow a table: what drives another FMU in a master that
   takes inputs from FMUs alone. table.h, generated, says TOKEN, REAL_COUNT, FLAG_COUNT, POINT_COUNT, STEP and
   VALUES[point][variable]; value references are places in a row, numbers before Booleans. */
#include "fmi2Functions.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "table.h"

typedef struct {
    double time;
} Signals;

/* Returns the row of the table that holds now. */
static const double *row(fmi2Component component) {
    const Signals *signals = component;
    const double point = floor(signals->time / STEP + 0.5);
    return VALUES[point < POINT_COUNT ? (size_t)point : POINT_COUNT - 1];
}

const char *fmi2GetTypesPlatform(void) {
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void) {
    return fmi2Version;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    (void)name, (void)resources, (void)functions, (void)visible, (void)logging;
    if (type != fmi2CoSimulation || !token || strcmp(token, TOKEN) != 0) return NULL;
    return calloc(1, sizeof(Signals));
}

void fmi2FreeInstance(fmi2Component component) {
    free(component);
}

fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean on, size_t count, const fmi2String names[]) {
    (void)component, (void)on, (void)count, (void)names;
    return fmi2OK;
}

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                               fmi2Real start_time, fmi2Boolean stop_time_defined, fmi2Real stop_time) {
    Signals *signals = component;
    (void)tolerance_defined, (void)tolerance, (void)stop_time_defined, (void)stop_time;
    signals->time = start_time;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component) {
    (void)component;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component) {
    (void)component;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component component) {
    (void)component;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component component) {
    ((Signals *)component)->time = 0.0;
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference references[], size_t count,
                       fmi2Real values[]) {
    for (size_t i = 0; i < count; i++) {
        if (references[i] >= REAL_COUNT) return fmi2Error;
        values[i] = row(component)[references[i]];
    }
    return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component component, const fmi2ValueReference references[], size_t count,
                          fmi2Boolean values[]) {
    for (size_t i = 0; i < count; i++) {
        if (references[i] < REAL_COUNT || references[i] >= REAL_COUNT + FLAG_COUNT) return fmi2Error;
        values[i] = row(component)[references[i]] != 0.0;
    }
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real time, fmi2Real step, fmi2Boolean final) {
    (void)final;
    ((Signals *)component)->time = time + step;
    return fmi2OK;
}

/* What no master asks of a table, but looks up. */
#define UNSUPPORTED(NAME, ...)                \
    fmi2Status fmi2##NAME(__VA_ARGS__) {      \
        return fmi2Error;                     \
    }
#define REFERENCES fmi2Component component, const fmi2ValueReference references[], size_t count

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

UNSUPPORTED(GetInteger, REFERENCES, fmi2Integer values[])
UNSUPPORTED(GetString, REFERENCES, fmi2String values[])
UNSUPPORTED(SetReal, REFERENCES, const fmi2Real values[])
UNSUPPORTED(SetInteger, REFERENCES, const fmi2Integer values[])
UNSUPPORTED(SetBoolean, REFERENCES, const fmi2Boolean values[])
UNSUPPORTED(SetString, REFERENCES, const fmi2String values[])
UNSUPPORTED(SetRealInputDerivatives, REFERENCES, const fmi2Integer orders[], const fmi2Real values[])
UNSUPPORTED(GetRealOutputDerivatives, REFERENCES, const fmi2Integer orders[], fmi2Real values[])
UNSUPPORTED(GetDirectionalDerivative, REFERENCES, const fmi2ValueReference known[], size_t known_count,
            const fmi2Real seed[], fmi2Real values[])
UNSUPPORTED(GetFMUstate, fmi2Component component, fmi2FMUstate *state)
UNSUPPORTED(SetFMUstate, fmi2Component component, fmi2FMUstate state)
UNSUPPORTED(FreeFMUstate, fmi2Component component, fmi2FMUstate *state)
UNSUPPORTED(SerializedFMUstateSize, fmi2Component component, fmi2FMUstate state, size_t *size)
UNSUPPORTED(SerializeFMUstate, fmi2Component component, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
UNSUPPORTED(DeSerializeFMUstate, fmi2Component component, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
UNSUPPORTED(CancelStep, fmi2Component component)
UNSUPPORTED(GetStatus, fmi2Component component, const fmi2StatusKind kind, fmi2Status *value)
UNSUPPORTED(GetRealStatus, fmi2Component component, const fmi2StatusKind kind, fmi2Real *value)
UNSUPPORTED(GetIntegerStatus, fmi2Component component, const fmi2StatusKind kind, fmi2Integer *value)
UNSUPPORTED(GetBooleanStatus, fmi2Component component, const fmi2StatusKind kind, fmi2Boolean *value)
UNSUPPORTED(GetStringStatus, fmi2Component component, const fmi2StatusKind kind, fmi2String *value)
