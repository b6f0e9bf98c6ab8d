/* Judges the flows of propellant. Keeps nothing. */
#include "flows.h"

#include "variables.h"

Status flows_check(Instance *instance) {
    enum { FIRST = REFERENCE_TORQUE + FLOW_PLACE };
    for (int i = FIRST; i < FIRST + FLOW_COUNT; i++) {
        const double flow = instance->now.values[i];
        if (flow >= 0.0) continue;
        return instance_refuse(instance, "%s = %.10g kg/s: must be >= 0", VARIABLES[i].name, flow);
    }
    return STATUS_OK;
}
