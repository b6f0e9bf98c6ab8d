/* Docks that open and close while the scene runs: which are closed (docks.c), and what closing one does to the angular
   velocity (docking.c). The tables are generated. */
#ifndef DOCKS_H
#define DOCKS_H

#include <string.h>

#include "changes.h"
#include "variables.h"

typedef struct {
    const char *ports[2], *vessels[2]; /* names */
    int vessel[2];                     /* numbers */
    int flag;                          /* place in p of the input that closes it; -1: it is always closed */
    int motion;                        /* place among the inputs of motion at contact, or -1 */
} Dock;

/* DOCK_COUNT of them. */
extern const Dock DOCKS[];

/* The name of the input that closes a dock. */
static inline const char *flag_name(const Dock *dock) {
    return VARIABLES[REFERENCE_P + dock->flag].name;
}

#if DOCK_COUNT

/* Judges which docks are closed; p holds their flags. */
Status docks_check(Instance *instance, const double p[]);

/* Adds to the rate what the docks that close bring along; c is the composite with them closed. */
void docks_join(Instance *instance, const double p[], const double c[], double rate[RATE_COUNT]);

/* Carries a small change of the rate [rad/s] from before docks close to after it; v has those of the inputs and the
   composite. Reverse: carries weights on the rate back, and adds to those on the composite and on the inputs. */
void docks_join_forward(Instance *instance, const Variation *v, const double rate[RATE_COUNT],
                        double change[RATE_COUNT]);
void docks_join_reverse(Instance *instance, const double rate[RATE_COUNT], double weight[RATE_COUNT],
                        double on_composite[], Variation *v);

#if HANDED_COUNT
/* The velocity of the barycentre relative to the root vessel [m/s] that the docks that close bring along. Forward: its
   small change by the motion at contact and all else in v->inputs. Reverse: adds to the weights on these. */
void docks_contact_velocity(Instance *instance, const double p[], double velocity[3]);
void docks_contact_velocity_forward(Instance *instance, const Variation *v, double velocity[3]);
void docks_contact_velocity_reverse(Instance *instance, const double weight[3], Variation *v);
#endif

/* The name of the input of the first dock that closes, or NULL. */
const char *docks_first_closing(const Instance *instance, const double p[]);

#else

static inline Status docks_check(Instance *instance, const double p[]) {
    (void)instance, (void)p;
    return STATUS_OK;
}

static inline void docks_join(Instance *instance, const double p[], const double c[], double rate[RATE_COUNT]) {
    (void)instance, (void)p, (void)c, (void)rate;
}

static inline void docks_join_forward(Instance *instance, const Variation *v, const double rate[RATE_COUNT],
                                      double change[RATE_COUNT]) {
    (void)instance, (void)v, (void)rate, (void)change;
}

static inline void docks_join_reverse(Instance *instance, const double rate[RATE_COUNT], double weight[RATE_COUNT],
                                      double on_composite[], Variation *v) {
    (void)instance, (void)rate, (void)weight, (void)on_composite, (void)v;
}

static inline void docks_contact_velocity(Instance *instance, const double p[], double velocity[3]) {
    (void)instance, (void)p;
    memset(velocity, 0, 3 * sizeof *velocity);
}

static inline void docks_contact_velocity_forward(Instance *instance, const Variation *v, double velocity[3]) {
    (void)instance, (void)v;
    memset(velocity, 0, 3 * sizeof *velocity);
}

static inline void docks_contact_velocity_reverse(Instance *instance, const double weight[3], Variation *v) {
    (void)instance, (void)weight, (void)v;
}

static inline const char *docks_first_closing(const Instance *instance, const double p[]) {
    (void)instance, (void)p;
    return NULL;
}

#endif

#endif
