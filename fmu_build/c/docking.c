/* What docks that close do to the angular velocity: the vessel that docks brings the momentum of its motion at contact.

   Needs of the model: contact_momentum and docked_rate with their derivatives; the inputs of motion at contact, which
   count only where a dock closes. */
#include <string.h>

#include "docks.h"
#include "model.h"

static bool closes(const Instance *instance, const Dock *dock, const double p[]) {
    return dock->flag >= 0 && p[dock->flag] != 0.0 && instance->now.stepped_p[dock->flag] == 0.0;
}

/* Takes what belongs to docks that do not close off numbers that stand as the motion at contact does. */
static void leave_closing(const Instance *instance, const double p[], double motion[]) {
    for (size_t i = 0; i < DOCK_COUNT; i++)
        if (DOCKS[i].flag >= 0 && !closes(instance, &DOCKS[i], p))
            memset(&motion[DOCKS[i].motion], 0, 6 * sizeof(double));
}

/* Adds weights on the inputs p and on the motion at contact to those in v; of the latter those of docks that close. */
static void weigh_contact(const Instance *instance, const double p[], const double on_p[], double on_motion[],
                          Variation *v) {
    leave_closing(instance, p, on_motion);
    for (size_t i = 0; i < INPUT_P_COUNT; i++) v->inputs[i] += on_p[i];
    for (size_t i = 0; i < INPUT_K_COUNT; i++) v->inputs[INPUT_P_COUNT + i] += on_motion[i];
}

/* The motion at contact of the docks that close. */
static void read_motion(const Instance *instance, const double p[], double motion[]) {
    memcpy(motion, &instance->now.values[REFERENCE_CONTACT], INPUT_K_COUNT * sizeof(double));
    leave_closing(instance, p, motion);
}

/* The same, and the momentum that it brings. */
static void motion_at_contact(Instance *instance, const double p[], double motion[], double momentum[3]) {
    read_motion(instance, p, motion);
    instance->arg[0] = p;
    instance->arg[1] = motion;
    instance->res[0] = momentum;
    contact_momentum(instance->arg, instance->res, instance->iw, instance->w, 0);
}

void docks_join(Instance *instance, const double p[], const double c[], double rate[RATE_COUNT]) {
    double motion[INPUT_K_COUNT], momentum[3], next[3];
    motion_at_contact(instance, p, motion, momentum);
    instance->arg[0] = rate;
    instance->arg[1] = momentum;
    instance->arg[2] = c;
    instance->res[0] = next;
    docked_rate(instance->arg, instance->res, instance->iw, instance->w, 0);
    memcpy(rate, next, sizeof next);
}

void docks_join_forward(Instance *instance, const Variation *v, const double rate[RATE_COUNT],
                        double change[RATE_COUNT]) {
    const double *p = instance->now.p;
    if (!docks_first_closing(instance, p)) return;
    double motion[INPUT_K_COUNT], small_motion[INPUT_K_COUNT], momentum[3], brought[3], next[3];
    motion_at_contact(instance, p, motion, momentum);
    memcpy(small_motion, v->inputs + INPUT_P_COUNT, sizeof small_motion);
    leave_closing(instance, p, small_motion);
    const double *const contact[] = {p, motion, v->inputs, small_motion};
    memcpy(instance->arg, contact, sizeof contact);
    instance->res[0] = brought;
    contact_momentum_forward(instance->arg, instance->res, instance->iw, instance->w, 0);
    const double *const docking[] = {rate, momentum, instance->now.c, change, brought, v->c};
    memcpy(instance->arg, docking, sizeof docking);
    instance->res[0] = next;
    docked_rate_forward(instance->arg, instance->res, instance->iw, instance->w, 0);
    memcpy(change, next, sizeof next);
}

void docks_join_reverse(Instance *instance, const double rate[RATE_COUNT], double weight[RATE_COUNT],
                        double on_composite[], Variation *v) {
    const double *p = instance->now.p;
    if (!docks_first_closing(instance, p)) return;
    double motion[INPUT_K_COUNT], momentum[3], on_rate[RATE_COUNT], brought[3], wc[COMPOSITE_COUNT];
    double on_p[INPUT_P_COUNT], on_motion[INPUT_K_COUNT];
    motion_at_contact(instance, p, motion, momentum);
    const double *const docking[] = {rate, momentum, instance->now.c, weight};
    double *const weights[] = {on_rate, brought, wc};
    memcpy(instance->arg, docking, sizeof docking);
    memcpy(instance->res, weights, sizeof weights);
    docked_rate_reverse(instance->arg, instance->res, instance->iw, instance->w, 0);
    const double *const contact[] = {p, motion, brought};
    double *const on_inputs[] = {on_p, on_motion};
    memcpy(instance->arg, contact, sizeof contact);
    memcpy(instance->res, on_inputs, sizeof on_inputs);
    contact_momentum_reverse(instance->arg, instance->res, instance->iw, instance->w, 0);
    weigh_contact(instance, p, on_p, on_motion, v);
    for (size_t i = 0; i < COMPOSITE_COUNT; i++) on_composite[i] += wc[i];
    memcpy(weight, on_rate, 3 * sizeof(double));
}

#if HANDED_COUNT

void docks_contact_velocity(Instance *instance, const double p[], double velocity[3]) {
    double motion[INPUT_K_COUNT];
    read_motion(instance, p, motion);
    instance->arg[0] = p;
    instance->arg[1] = motion;
    instance->res[0] = velocity;
    instance_call(instance, contact_velocity, false);
}

void docks_contact_velocity_forward(Instance *instance, const Variation *v, double velocity[3]) {
    const double *p = instance->now.p;
    double motion[INPUT_K_COUNT], small_motion[INPUT_K_COUNT];
    read_motion(instance, p, motion);
    memcpy(small_motion, v->inputs + INPUT_P_COUNT, sizeof small_motion);
    leave_closing(instance, p, small_motion);
    const double *const arguments[] = {p, motion, v->inputs, small_motion};
    memcpy(instance->arg, arguments, sizeof arguments);
    instance->res[0] = velocity;
    contact_velocity_forward(instance->arg, instance->res, instance->iw, instance->w, 0);
}

void docks_contact_velocity_reverse(Instance *instance, const double weight[3], Variation *v) {
    const double *p = instance->now.p;
    double motion[INPUT_K_COUNT], on_p[INPUT_P_COUNT], on_motion[INPUT_K_COUNT];
    read_motion(instance, p, motion);
    const double *const arguments[] = {p, motion, weight};
    double *const weights[] = {on_p, on_motion};
    memcpy(instance->arg, arguments, sizeof arguments);
    memcpy(instance->res, weights, sizeof weights);
    contact_velocity_reverse(instance->arg, instance->res, instance->iw, instance->w, 0);
    weigh_contact(instance, p, on_p, on_motion, v);
}

#endif

const char *docks_first_closing(const Instance *instance, const double p[]) {
    for (size_t i = 0; i < DOCK_COUNT; i++)
        if (closes(instance, &DOCKS[i], p)) return flag_name(&DOCKS[i]);
    return NULL;
}
