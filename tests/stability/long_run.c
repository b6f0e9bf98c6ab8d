/* Loads the library of an FMI 3.0 co-simulation FMU, steps it from its start and watches what motion without torque
   keeps.

   long_run LIBRARY TOKEN STEPS SIZE TOLERANCE ATTITUDE MOMENTUM ENERGY
   TOLERANCE 0: the scene's. The last three are the first value references of attitude (4), angular momentum in
   inertial axes (3) and kinetic energy.
   Prints the largest changes over all steps, relative: of the energy, of the momentum's length, of the momentum as a
   vector; then how far the attitude's length came off 1. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "library.h"

static double length_of(const double v[], int count) {
    double square = 0.0;
    for (int i = 0; i < count; i++) square += v[i] * v[i];
    return sqrt(square);
}

static void keep_largest(double *largest, double value) {
    if (!(value <= *largest)) *largest = value; /* NaN too */
}

int main(int count, char **words) {
    if (count != 9) return 2;
    void *library = load(words[1]);
    fmi3InstantiateCoSimulationTYPE *instantiate = look_up(library, "fmi3InstantiateCoSimulation");
    fmi3EnterInitializationModeTYPE *enter = look_up(library, "fmi3EnterInitializationMode");
    fmi3ExitInitializationModeTYPE *leave = look_up(library, "fmi3ExitInitializationMode");
    fmi3GetFloat64TYPE *get_values = look_up(library, "fmi3GetFloat64");
    fmi3DoStepTYPE *do_step = look_up(library, "fmi3DoStep");
    const long steps = strtol(words[3], NULL, 10);
    const double size = strtod(words[4], NULL), tolerance = strtod(words[5], NULL);
    fmi3ValueReference got[8];
    for (unsigned i = 0; i < 4; i++) got[i] = (fmi3ValueReference)strtoul(words[6], NULL, 10) + i;
    for (unsigned i = 0; i < 3; i++) got[4 + i] = (fmi3ValueReference)strtoul(words[7], NULL, 10) + i;
    got[7] = (fmi3ValueReference)strtoul(words[8], NULL, 10);
    fmi3Instance f = instantiate("long", words[2], NULL, false, true, false, false, NULL, 0, NULL, log_message, NULL);
    if (!f) return 1;
    check(enter(f, tolerance > 0.0, tolerance, 0.0, false, 0.0), "enter");
    check(leave(f), "leave");
    double first[8], now[8], change[3], of_energy = 0.0, of_length = 0.0, of_momentum = 0.0, of_attitude = 0.0;
    check(get_values(f, got, 8, first, 8), "get");
    const double momentum = length_of(first + 4, 3);
    fmi3Boolean event, terminate, early;
    double time = 0.0;
    for (long i = 0; i < steps; i++) {
        check(do_step(f, time, size, true, &event, &terminate, &early, &time), "step");
        check(get_values(f, got, 8, now, 8), "get");
        for (int k = 0; k < 3; k++) change[k] = now[4 + k] - first[4 + k];
        keep_largest(&of_energy, fabs(now[7] / first[7] - 1.0));
        keep_largest(&of_length, fabs(length_of(now + 4, 3) / momentum - 1.0));
        keep_largest(&of_momentum, length_of(change, 3) / momentum);
        keep_largest(&of_attitude, fabs(length_of(now, 4) - 1.0));
    }
    printf("%.3g %.3g %.3g %.3g\n", of_energy, of_length, of_momentum, of_attitude);
    return 0;
}
