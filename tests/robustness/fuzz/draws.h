/* Random choices, by xorshift64*: numbers, values and references of variables. The digest of all answers. */
#ifndef FUZZ_DRAWS_H
#define FUZZ_DRAWS_H

#include "instances.h"

static uint64_t draw(void) {
    random_state ^= random_state >> 12;
    random_state ^= random_state << 25;
    random_state ^= random_state >> 27;
    return random_state * UINT64_C(2685821657736338717);
}

static unsigned below(unsigned count) {
    return (unsigned)((draw() >> 33) % count);
}

static bool once_in(unsigned count) {
    return below(count) == 0;
}

static double uniform(double low, double high) {
    return low + (high - low) * ((double)(draw() >> 11) / 9007199254740992.0);
}

/* A torque [N m] under which a step begins and is refused after some sub-steps. */
static const double SPINNING_UP = 2e18;

/* No odd number makes a step need millions of sub-steps and yet be taken. */
static double odd_number(void) {
    static const double odd[] = {0.0,    -0.0,  1.0,    -1.0,  5e-324, -1e-310,  DBL_MIN, 1e-200,
                                 1e-150, 1e150, -1e150, 1e200, 1e308,  -DBL_MAX, 0.1,     DBL_EPSILON};
    return odd[below(sizeof odd / sizeof odd[0])];
}

static double no_number(void) {
    return once_in(2) ? (double)NAN : once_in(2) ? (double)INFINITY : -(double)INFINITY;
}

/* A value for a variable: mostly near the scene's, now and then odd, seldom not finite. */
static double value_for(unsigned reference) {
    if (once_in(300)) return no_number();
    if (reference >= VARIABLE_COUNT || once_in(60)) return odd_number();
    const Variable *variable = &VARIABLES[reference];
    if (variable->role == ROLE_STATE || variable->role == ROLE_PARAMETER) return uniform(-1.0, 1.0);
    if (reference >= REFERENCE_TORQUE && variable->role == ROLE_INPUT)
        return once_in(10) ? SPINNING_UP : uniform(-1e3, 1e3);
    return variable->start == 0.0 ? uniform(0.0, 0.1) : variable->start * uniform(0.95, 1.05);
}

static bool is_boolean(unsigned reference) {
#if DOCK_COUNT
    return reference < VARIABLE_COUNT && VARIABLES[reference].type == TYPE_BOOLEAN;
#else
    (void)reference;
    return false;
#endif
}

/* The reference of some number of a role. */
static unsigned reference_of(Role role) {
    unsigned reference = below(VARIABLE_COUNT);
    while (VARIABLES[reference].role != role || is_boolean(reference)) reference = (reference + 1) % VARIABLE_COUNT;
    return reference;
}

static unsigned any_reference(void) {
    const unsigned reference = below(VARIABLE_COUNT);
    if (!once_in(150)) return is_boolean(reference) && !once_in(20) ? (unsigned)REFERENCE_TIME : reference;
    return once_in(2) ? (unsigned)VARIABLE_COUNT : once_in(2) ? UINT_MAX : (unsigned)draw();
}

/* An array on the heap of just this size, so that a sanitizer sees what reaches beyond it. */
static void *array(size_t count, size_t size) {
    void *bytes = calloc(count + (count == 0), size);
    if (!bytes) abort();
    return bytes;
}

static void note(const void *bytes, size_t size) {
    for (size_t i = 0; i < size; i++) digest = (digest ^ ((const unsigned char *)bytes)[i]) * UINT64_C(1099511628211);
}

static void note_values(const double values[], size_t count) {
    for (size_t i = 0; i < count; i++) {
        const double value = isnan(values[i]) ? 0.5 : values[i]; /* the bits of a NaN are the machine's */
        note(&value, sizeof value);
    }
}

#endif
