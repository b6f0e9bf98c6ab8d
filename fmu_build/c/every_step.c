/* The plan of a scene that names a method with steps of its own: all sub-steps are the method's. */
#include "solver.h"

Status solver_advance(Instance *instance, Progress *progress) {
    return solver_sub_step(instance, progress);
}
