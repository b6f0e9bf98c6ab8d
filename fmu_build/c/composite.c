/* The composite that follows from the inputs, and whether their values can be used: judges each, computes mass,
   barycentre and inertia, judges these together. A value that cannot be used is refused here (instance_refuse: Discard,
   or Error where FMI 2.0 has it so).

   Owns composite_is_current, composite_is_ordinary, axes_are_current and a of Dynamics, and the candidate in scratch; p
   and c become current by changes_apply. Needs of the model: composite, axes. */
#include "composite.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "changes.h"
#include "docks.h"
#include "model.h"
#include "variables.h"

/* Fourth powers of lengths within these bounds neither under- nor overflow. */
static const double SHORTEST = 1e-60;
static const double LONGEST = 1e60;

static Status check_mass(Instance *instance, const Variable *variable, const double *mass, bool has_wheels) {
    if (has_wheels && *mass == 0.0)
        return instance_refuse(instance, "%s = 0 kg: must be > 0, since the vessel has wheels", variable->name);
    if (*mass >= 0.0) return STATUS_OK;
    return instance_refuse(instance, "%s = %.10g kg: must be >= 0", variable->name, *mass);
}

enum { NUMBER_SIZE = 32 };

/* Writes a number with as many digits as tell it from its neighbours. */
static const char *all_digits(double value, char text[NUMBER_SIZE]) {
    for (int digits = 6; digits <= 17; digits++) {
        snprintf(text, NUMBER_SIZE, "%.*g", digits, value);
        if (strtod(text, NULL) == value) break;
    }
    return text;
}

static Status check_pmi(Instance *instance, const Variable *variable, const double *k) {
    double small = k[0], middle = k[1], large = k[2];
    if (large < middle) { const double swap = large; large = middle; middle = swap; }
    if (middle < small) { const double swap = middle; middle = small; small = swap; }
    if (large < middle) { const double swap = large; large = middle; middle = swap; }
    if (small < 0.0)
        return instance_refuse(instance, "%.*s = (%.10g, %.10g, %.10g) m2: must be >= 0", group_length(variable),
                               variable->name, k[0], k[1], k[2]);
    const double scale = large > 0x1p1000 ? 0.5 : 1.0; /* the sum of two may be no double */
    const double excess = (scale * large - (scale * small + scale * middle)) / scale;
    if (!TRIANGLE_JUDGED || excess <= TRIANGLE_SLACK * large) return STATUS_OK;
    char text[3][NUMBER_SIZE];
    return instance_refuse(instance,
                           "%.*s = (%.10g, %.10g, %.10g) m2: %s exceeds %s + %s by %.6g; no rigid body has these "
                           "moments",
                           group_length(variable), variable->name, k[0], k[1], k[2], all_digits(large, text[0]),
                           all_digits(small, text[1]), all_digits(middle, text[2]), excess);
}

/* Scales a vector by a power of two, exactly, so that its square is far from under- and overflow. Returns the
   exponent of that power. */
static int scale_vector(double v[3]) {
    const double largest = fmax(fabs(v[0]), fmax(fabs(v[1]), fabs(v[2])));
    int exponent = 0;
    if (largest > 0.0 && (largest < SHORTEST || largest > LONGEST)) {
        frexp(largest, &exponent);
        for (size_t i = 0; i < 3; i++) v[i] = ldexp(v[i], -exponent);
    }
    return -exponent;
}

static double square_of(const double v[3]) {
    return v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
}

/* Judges direction and alignment, which stand one after the other; p holds them and gets them scaled. */
static Status check_port(Instance *instance, const Variable *variable, const double *values, double *p) {
    double *d = p, *a = p + 3;
    for (size_t i = 0; i < 6; i += 3) {
        scale_vector(p + i);
        if (p[i] != 0.0 || p[i + 1] != 0.0 || p[i + 2] != 0.0) continue;
        return instance_refuse(instance, "%.*s = (0, 0, 0): must have a length greater than 0",
                               group_length(&variable[i]), variable[i].name);
    }
    const double across[3] = {d[1] * a[2] - d[2] * a[1], d[2] * a[0] - d[0] * a[2], d[0] * a[1] - d[1] * a[0]};
    const double square = square_of(across), squares[2] = {square_of(d), square_of(a)};
    if (square > 2.0 * PARALLEL_LIMIT * PARALLEL_LIMIT * (squares[0] * squares[1])) return STATUS_OK; /* far from it */
    if (sqrt(square) >= PARALLEL_LIMIT * (sqrt(squares[0]) * sqrt(squares[1]))) return STATUS_OK;
    return instance_refuse(instance,
                           "%.*s = (%.10g, %.10g, %.10g): must not be parallel to %.*s = (%.10g, %.10g, %.10g) within "
                           "%g rad",
                           group_length(&variable[3]), variable[3].name, values[3], values[4], values[5],
                           group_length(variable), variable->name, values[0], values[1], values[2], PARALLEL_LIMIT);
}

/* Judges the inputs; p holds them and gets directions and alignments scaled. Of those that stand as they do in the
   current composite, as judged then and scaled, moments and ports need not be judged again. */
static Status check_inputs(Instance *instance, double p[]) {
    const Dynamics *now = &instance->now;
    const bool judged_before = now->c[COMPOSITE_MASS] > 0.0;
    Status status = STATUS_OK;
    if (INPUT_P_COUNT == 0) return status;
    for (const Judged *judged = JUDGED; judged->check != CHECK_NONE && status == STATUS_OK; judged++) {
        static const size_t together[] = {[CHECK_PMI] = 3, [CHECK_PORT] = 6};
        const size_t place = judged->reference - REFERENCE_P;
        const Variable *variable = &VARIABLES[judged->reference];
        const double *value = &now->values[judged->reference];
        const bool has_wheels = STATE_COUNT > 7 && judged->check == CHECK_MASS_OF_WHEELS;
        if (judged->check == CHECK_MASS || has_wheels)
            status = check_mass(instance, variable, value, has_wheels);
        else if (judged_before && memcmp(value, &now->p[place], together[judged->check] * sizeof *value) == 0)
            continue;
        else if (judged->check == CHECK_PMI)
            status = check_pmi(instance, variable, value);
        else if (PORT_COUNT > 0)
            status = check_port(instance, variable, value, &p[place]);
    }
    return status == STATUS_OK ? docks_check(instance, p) : status;
}

static bool has_mass(const double *c) {
    return c[COMPOSITE_MASS] > 0.0 && c[COMPOSITE_MASS] <= DBL_MAX;
}

bool composite_is_usable(const double c[]) {
    const size_t count = LAW_TURNS ? COMPOSITE_COUNT : COMPOSITE_MARGINS;
    bool usable = has_mass(c);
    for (size_t i = 0; i < count; i++) usable = usable && isfinite(c[i]);
    for (size_t i = COMPOSITE_MARGINS; i < COMPOSITE_LAW && LAW_TURNS; i++) usable = usable && c[i] > 0.0;
    return usable;
}

/* Judges what the inputs make together. */
static Status check_composite(Instance *instance, const double *c) {
    if (!has_mass(c))
        return instance_refuse(instance, "mass = %.10g kg: the total of all vessels must be finite and > 0",
                               c[COMPOSITE_MASS]);
    if (composite_is_usable(c)) return STATUS_OK;
    const double *h = &c[COMPOSITE_SPIN];
    if (SPINS && !isfinite(h[3]) && isfinite(c[COMPOSITE_MARGINS]))
        return instance_refuse(instance,
                               "the ports that move give the vessels (%.10g, %.10g, %.10g) N.m.s: what this does "
                               "leaves the range of finite numbers",
                               h[0], h[1], h[2]);
    const double *J = &c[COMPOSITE_INERTIA];
    return instance_refuse(instance,
                           STATE_COUNT > 7 ? "inertia (xx, yy, zz, xy, xz, yz) = (%.10g, %.10g, %.10g, %.10g, %.10g, "
                                             "%.10g) kg.m2, less what wheels have about their axes: must be finite%s"
                                           : "inertia (xx, yy, zz, xy, xz, yz) = (%.10g, %.10g, %.10g, %.10g, %.10g, "
                                             "%.10g) kg.m2: must be finite%s",
                           J[0], J[1], J[2], J[3], J[4], J[5], LAW_TURNS ? " and positive definite" : "");
}

void composite_compute(Instance *instance, const double p[], double c[]) {
    instance->arg[0] = p;
    instance->res[0] = c;
    composite(instance->arg, instance->res, instance->iw, instance->w, 0);
}

/* Whether inputs and composite are of a size up to the limit, and mass and moments as far from zero. */
static bool are_all_within(const double p[], const double c[], double limit) {
    const double least = 1.0 / limit;
    bool within = are_within(p, INPUT_P_COUNT, limit) && are_within(c, COMPOSITE_COUNT, limit);
    within = within && c[COMPOSITE_MASS] >= least;
    for (size_t i = COMPOSITE_MARGINS; i < COMPOSITE_LAW && LAW_TURNS; i++) within = within && c[i] >= least;
    return within;
}

Status composite_refresh(Instance *instance) {
    Dynamics *now = &instance->now;
    if (now->composite_is_current) return STATUS_OK;
    double *p = instance->scratch.candidate.p, *c = instance->scratch.candidate.c;
    memcpy(p, &now->values[REFERENCE_P], INPUT_P_COUNT * sizeof(double));
    Status status = check_inputs(instance, p);
    if (status != STATUS_OK) return status;
    if (now->c[COMPOSITE_MASS] > 0.0 && memcmp(p, now->p, INPUT_P_COUNT * sizeof(double)) == 0) {
        if (CHANGES) status = changes_apply(instance, now->p, now->c);
        now->composite_is_current = status == STATUS_OK; /* changed there and back */
        return status;
    }
    composite_compute(instance, p, c);
    status = check_composite(instance, c);
    if (status == STATUS_OK) status = changes_apply(instance, p, c);
    if (status != STATUS_OK) return status;
    now->composite_is_current = true;
    now->composite_is_ordinary = are_all_within(now->p, now->c, ORDINARY);
    now->axes_are_current = false;
    instance->outputs_are_current = instance->rates_are_current = false;
    instance_inform(instance, LOG_COMPOSITE, "composite computed at %.10g s: mass = %.10g kg",
                    now->values[REFERENCE_TIME], c[COMPOSITE_MASS]);
    return STATUS_OK;
}

void composite_refresh_axes(Instance *instance) {
    if (instance->now.axes_are_current) return;
#if AXES_COUNT
    instance->arg[0] = instance->now.c;
    instance->res[0] = instance->now.a;
    /* what the bound of the error needs leaves the range of doubles before moments and axes do */
    instance_call(instance, axes, !ERROR_BOUND || instance->now.composite_is_ordinary);
    if (ERROR_BOUND)
        instance->now.constants_are_tame = are_within(instance->now.a, AXES_COUNT, TAME_CONSTANTS) &&
                                           are_within(instance->now.c, COMPOSITE_COUNT, TAME_CONSTANTS);
#endif
    instance->now.axes_are_current = true;
    instance->outputs_are_current = false;
}

void composite_scale_variation(const Instance *instance, double p[]) {
    if (PORT_COUNT == 0) return;
    for (const Judged *judged = JUDGED; judged->check != CHECK_NONE; judged++) {
        const size_t i = judged->reference;
        if (judged->check != CHECK_PORT) continue;
        for (size_t k = i; k < i + 6; k += 3) {
            double scaled[3];
            memcpy(scaled, &instance->now.values[k], sizeof scaled);
            const int exponent = scale_vector(scaled);
            for (size_t n = k; n < k + 3; n++) p[n - REFERENCE_P] = ldexp(p[n - REFERENCE_P], exponent);
        }
    }
}
