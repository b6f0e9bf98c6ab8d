#include <math.h>
#include <string.h>

#include "instance.h"
#include "model.h"

/* Whether all references can be used as the call asks; logs the first that cannot. */
static Status check_references(Instance *instance, const unsigned references[], size_t count, const void *values) {
    if (count == 0) return STATUS_OK;
    if (!references) return instance_error(instance, "valueReferences is NULL");
    if (!values) return instance_error(instance, "values is NULL");
    for (size_t i = 0; i < count; i++)
        if (references[i] >= VARIABLE_COUNT)
            return instance_error(instance, "value reference %u is unknown; the largest is %d", references[i],
                                  VARIABLE_COUNT - 1);
    return STATUS_OK;
}

static Status refresh_outputs(Instance *instance) {
    if (instance->outputs_are_current) return STATUS_OK;
    instance->arg[0] = instance->x;
    instance->arg[1] = &instance->values[REFERENCE_TORQUE];
    instance->arg[2] = instance->c;
    instance->res[0] = &instance->values[REFERENCE_OUTPUTS];
    outputs(instance->arg, instance->res, instance->iw, instance->w, 0);
    instance->outputs_are_current = true;
    return STATUS_OK;
}

/* Makes the outputs that are asked for follow from state and inputs. A composite that cannot be computed
   spoils only what depends on it. */
static Status prepare_outputs(Instance *instance, const unsigned references[], size_t count) {
    bool wanted = false, shaped = false;
    for (size_t i = 0; i < count; i++) {
        wanted = wanted || VARIABLES[references[i]].causality == CAUSALITY_OUTPUT;
        shaped = shaped || (VARIABLES[references[i]].causality == CAUSALITY_OUTPUT &&
                            VARIABLES[references[i]].shapes_composite);
    }
    if (!wanted) return STATUS_OK;
    if (instance->state & (INSTANTIATED | INITIALIZATION)) {
        instance->outputs_are_current = false;
        const Status status = instance_start_state(instance);
        if (status != STATUS_OK) return status;
    }
    if (shaped) {
        const Status status = composite_refresh(instance);
        if (status != STATUS_OK) return status;
    }
    return refresh_outputs(instance);
}

Status instance_get(Instance *instance, const unsigned references[], size_t count, double values[]) {
    Status status = check_references(instance, references, count, values);
    if (status == STATUS_OK) status = prepare_outputs(instance, references, count);
    if (status != STATUS_OK) return status;
    for (size_t i = 0; i < count; i++)
        values[i] = VARIABLES[references[i]].causality == CAUSALITY_INDEPENDENT ? instance->time
                                                                               : instance->values[references[i]];
    return STATUS_OK;
}

static Status check_settable(Instance *instance, const Variable *variable) {
    if (variable->causality == CAUSALITY_INPUT) return STATUS_OK;
    if (variable->causality == CAUSALITY_PARAMETER) {
        if (instance->state & (INSTANTIATED | INITIALIZATION)) return STATUS_OK;
        return instance_error(instance, "%s is a fixed parameter and cannot be set after initialisation",
                              variable->name);
    }
    return instance_error(instance, "%s is %s and cannot be set", variable->name,
                          variable->causality == CAUSALITY_OUTPUT ? "an output" : "the independent variable");
}

Status instance_set(Instance *instance, const unsigned references[], size_t count, const double values[]) {
    Status status = check_references(instance, references, count, values);
    for (size_t i = 0; i < count && status == STATUS_OK; i++)
        status = check_settable(instance, &VARIABLES[references[i]]);
    for (size_t i = 0; i < count && status == STATUS_OK; i++)
        if (!isfinite(values[i]))
            status = instance_refuse(instance, "%s = %.10g %s: must be finite", VARIABLES[references[i]].name,
                                     values[i], VARIABLES[references[i]].unit);
    if (status != STATUS_OK) return status;
    for (size_t i = 0; i < count; i++) {
        double *value = &instance->values[references[i]];
        if (*value == values[i]) continue;
        *value = values[i];
        instance->outputs_are_current = false;
        if (VARIABLES[references[i]].shapes_composite) instance->composite_is_current = false;
    }
    return STATUS_OK;
}
