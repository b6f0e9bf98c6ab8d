/* The plan of the propagator auto where something may act: a communication step of free motion where nothing acts and
   the composite is that of the step before, a sub-step of the other method elsewhere. */
#include "free_step.h"

Status solver_advance(Instance *instance, Progress *progress) {
    progress->was_free = is_free(instance) && !composite_changed(instance);
    return progress->was_free ? free_step(instance, progress, false) : solver_sub_step(instance, progress);
}
