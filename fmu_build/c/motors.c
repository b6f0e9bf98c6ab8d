/* Judges the motors of wheels whose vessels have left the root: such a wheel keeps its momentum. Keeps nothing; needs
   the table MOTORS. */
#include "motors.h"

#include "variables.h"

Status motors_check(Instance *instance) {
    const Dynamics *now = &instance->now;
    for (size_t i = 0; i < MOTOR_COUNT; i++) {
        const int reference = REFERENCE_TORQUE + MOTORS[i].torque;
        const double *axis = &now->c[MOTORS[i].axis], torque = now->values[reference];
        if (torque == 0.0 || axis[0] != 0.0 || axis[1] != 0.0 || axis[2] != 0.0) continue;
        return instance_refuse(instance, "%s = %.10g N.m: must be 0 while docks do not hold the vessel to the root",
                               VARIABLES[reference].name, torque);
    }
    return STATUS_OK;
}
