/* Motors of wheels whose vessels docks can take off the root: while they do, the motors must rest (motors.c). The
   table is generated, where there is any such motor. */
#ifndef MOTORS_H
#define MOTORS_H

#include "instance.h"

typedef struct {
    int torque; /* place among the inputs that act */
    int axis;   /* place in c of the wheel's axis, three zeros while nothing holds its vessel to the root */
} Motor;

#ifdef MOTOR_COUNT

extern const Motor MOTORS[];

/* Refuses a torque other than 0 of a motor whose vessel is not held; the composite must be current. */
Status motors_check(Instance *instance);

#else

static inline Status motors_check(Instance *instance) {
    (void)instance;
    return STATUS_OK;
}

#endif

#endif
