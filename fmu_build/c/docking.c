/* What docks that close do to the angular velocity: the vessel that docks brings the momentum of its motion at contact.

   Needs of the model: contact_momentum, docked_rate; the inputs of motion at contact, which count only where a dock
   closes. */
#include <string.h>

#include "docks.h"
#include "model.h"

static bool closes(const Instance *instance, const Dock *dock, const double p[]) {
    return dock->flag >= 0 && p[dock->flag] != 0.0 && instance->now.stepped_p[dock->flag] == 0.0;
}

void docks_join(Instance *instance, const double p[], const double c[], double rate[3]) {
    double motion[INPUT_K_COUNT], momentum[3], next[3];
    memcpy(motion, &instance->now.values[REFERENCE_CONTACT], sizeof motion);
    for (size_t i = 0; i < DOCK_COUNT; i++)
        if (DOCKS[i].flag >= 0 && !closes(instance, &DOCKS[i], p))
            memset(&motion[DOCKS[i].motion], 0, 6 * sizeof(double));
    instance->arg[0] = p;
    instance->arg[1] = motion;
    instance->res[0] = momentum;
    contact_momentum(instance->arg, instance->res, instance->iw, instance->w, 0);
    instance->arg[0] = rate;
    instance->arg[1] = momentum;
    instance->arg[2] = c;
    instance->res[0] = next;
    docked_rate(instance->arg, instance->res, instance->iw, instance->w, 0);
    memcpy(rate, next, sizeof next);
}

const char *docks_first_closing(const Instance *instance, const double p[]) {
    for (size_t i = 0; i < DOCK_COUNT; i++)
        if (closes(instance, &DOCKS[i], p)) return flag_name(&DOCKS[i]);
    return NULL;
}
