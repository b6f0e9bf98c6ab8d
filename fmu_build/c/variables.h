/* The variable table of a scene. The table itself is generated (scene.c); this is its form. */
#ifndef VARIABLES_H
#define VARIABLES_H

#include <stdbool.h>
#include <stddef.h>

#include "scene.h"

typedef enum {
    CAUSALITY_INDEPENDENT,
    CAUSALITY_INPUT,
    CAUSALITY_PARAMETER,
    CAUSALITY_OUTPUT
} Causality;

/* What a value must be beside finite. A check stands at the first element of what is judged together. */
typedef enum {
    CHECK_NONE,
    CHECK_MASS,   /* >= 0 */
    CHECK_PMI,    /* three moments >= 0 that obey the triangle inequality */
    CHECK_PORT    /* direction[3] and alignment[3]: lengths > 0, not parallel */
} Check;

typedef struct {
    const char *name;
    const char *unit;
    double start;
    Causality causality;
    Check check;
    bool shapes_composite;   /* an input that the composite depends on, or an output that follows from it */
} Variable;

/* Indexed by value reference. */
extern const Variable VARIABLES[VARIABLE_COUNT];

extern const char MODEL_TOKEN[];

#endif
