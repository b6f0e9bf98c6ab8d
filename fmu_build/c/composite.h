/* The composite c of the inputs p that shape it: mass, barycentre, inertia and what the rotation law needs of them. */
#ifndef COMPOSITE_H
#define COMPOSITE_H

#include "instance.h"

/* Makes c follow from the inputs, unless it does: judges them and computes the composite. */
Status composite_refresh(Instance *instance);

/* Makes a follow from c, unless it does. */
void composite_refresh_axes(Instance *instance);

/* Computes a composite c, of inputs p that have been judged one by one. */
void composite_compute(Instance *instance, const double p[], double c[]);

/* Whether motion can be computed with a composite. */
bool composite_is_usable(const double c[]);

/* Multiplies a change of p, or weights on p as scaled, by the powers of two that the directions were scaled by. */
void composite_scale_variation(const Instance *instance, double p[]);

#endif
