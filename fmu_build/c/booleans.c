/* Getting and setting Booleans, which are discrete: they change before the start and in event mode alone. */
#include "booleans.h"

Status instance_check_booleans(Instance *instance, const unsigned references[], size_t count, const void *values) {
    if (count == 0) return STATUS_OK;
    if (!references || !values) return instance_error(instance, "an array is NULL");
    for (size_t i = 0; i < count; i++) {
        if (references[i] >= VARIABLE_COUNT) return instance_unknown_reference(instance, references[i]);
        if (!is_boolean(references[i]))
            return instance_error(instance, "%s is a number, not a Boolean", VARIABLES[references[i]].name);
    }
    return STATUS_OK;
}

Status instance_check_boolean(Instance *instance, unsigned reference, bool value) {
    const unsigned held = instance->event_mode_used ? STEPPING | CONTINUOUS : CONTINUOUS;
    if (!(instance->now.state & held) || value == instance_get_boolean(instance, reference)) return STATUS_OK;
    return instance_error(instance, "%s is discrete: once initialisation is left, it can be changed in event mode only",
                          VARIABLES[reference].name);
}

bool instance_get_boolean(const Instance *instance, unsigned reference) {
    return instance->now.values[reference] != 0.0;
}

void instance_set_boolean(Instance *instance, unsigned reference, bool value) {
    if (value == instance_get_boolean(instance, reference)) return;
    instance->now.values[reference] = value ? 1.0 : 0.0;
    instance->now.composite_is_current = instance->outputs_are_current = instance->rates_are_current = false;
}
