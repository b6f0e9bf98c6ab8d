/* Docks that open and close while the scene runs: which are closed (docks.c), and what closing one does to the angular
   velocity (docking.c). The tables are generated. */
#ifndef DOCKS_H
#define DOCKS_H

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
void docks_join(Instance *instance, const double p[], const double c[], double rate[3]);

/* The name of the input of the first dock that closes, or NULL. */
const char *docks_first_closing(const Instance *instance, const double p[]);

#else

static inline Status docks_check(Instance *instance, const double p[]) {
    (void)instance, (void)p;
    return STATUS_OK;
}

static inline void docks_join(Instance *instance, const double p[], const double c[], double rate[3]) {
    (void)instance, (void)p, (void)c, (void)rate;
}

static inline const char *docks_first_closing(const Instance *instance, const double p[]) {
    (void)instance, (void)p;
    return NULL;
}

#endif

#endif
