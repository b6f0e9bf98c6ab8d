/* The functions of FMI 2.0 that belong to capabilities which this FMU does not claim. They exist because
   importers look them up; each logs one line and returns an error. */
#include "fmi2Functions.h"

#include "instance.h"

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

static fmi2Status unsupported(Instance *instance, const Call *call) {
    if (!instance || !instance_admits(instance, call)) return fmi2Error;
    return (fmi2Status)instance_error(instance, "belongs to a capability that this FMU does not have");
}

#if DOCK_COUNT
#define BOOLEAN(X)
#define TYPES "all variables are Real or Boolean"
#else
#define BOOLEAN(X) X(Boolean)
#define TYPES "all variables are Real"
#endif

/* Any reference given to another type's function is wrong. */
static fmi2Status other_type(Instance *instance, const Call *call, size_t count) {
    if (!instance || !instance_admits(instance, call)) return fmi2Error;
    if (count == 0) return fmi2OK;
    return (fmi2Status)instance_error(instance, TYPES ", none has this type");
}

#define OTHER_TYPES(X) X(Integer) BOOLEAN(X) X(String)

#define DEFINE_ACCESSORS(TYPE)                                                                            \
    fmi2Status fmi2Get##TYPE(fmi2Component instance, const fmi2ValueReference references[], size_t count, \
                             fmi2##TYPE values[]) {                                                       \
        static const Call call = {"fmi2Get" #TYPE, ANY_STATE, STATUS_ERROR};                              \
        return other_type(instance, &call, count);                                                        \
    }                                                                                                     \
    fmi2Status fmi2Set##TYPE(fmi2Component instance, const fmi2ValueReference references[], size_t count, \
                             const fmi2##TYPE values[]) {                                                 \
        static const Call call = {"fmi2Set" #TYPE, ANY_STATE, STATUS_ERROR};                              \
        return other_type(instance, &call, count);                                                        \
    }

OTHER_TYPES(DEFINE_ACCESSORS)

#define UNSUPPORTED(X)                                                                                         \
    X(SetRealInputDerivatives, (fmi2Component instance, const fmi2ValueReference references[], size_t count,  \
                                const fmi2Integer orders[], const fmi2Real values[]))                         \
    X(CancelStep, (fmi2Component instance))

#define DEFINE_UNSUPPORTED(NAME, PARAMETERS)                              \
    fmi2Status fmi2##NAME PARAMETERS {                                    \
        static const Call call = {"fmi2" #NAME, ANY_STATE, STATUS_ERROR}; \
        return unsupported(instance, &call);                              \
    }

UNSUPPORTED(DEFINE_UNSUPPORTED)
