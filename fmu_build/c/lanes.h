/* The same arithmetic on several numbers at once, where the compiler knows a way; every lane has the bits of plain
   doubles. The loop's steps for several vessels (lane_kernels.h) are generated in terms of it. */
#ifndef LANES_H
#define LANES_H

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "scene.h"

/* What works on lanes is never called: its arguments would go through memory. */
#ifdef __GNUC__
#define LANES_INLINE static inline __attribute__((always_inline))
enum { LANES = LOOP_LANES };
typedef double Lanes __attribute__((vector_size(LOOP_LANES * sizeof(double))));
#else
#define LANES_INLINE static inline
enum { LANES = 1 };
typedef double Lanes;
#endif

#ifndef __has_builtin
#define __has_builtin(x) 0
#endif

LANES_INLINE Lanes lanes_of(const double lane[LANES]) {
    Lanes made;
    memcpy(&made, lane, sizeof made);
    return made;
}

LANES_INLINE double lane_of(Lanes x, size_t k) {
    double lane[LANES];
    memcpy(lane, &x, sizeof lane);
    return lane[k];
}

LANES_INLINE Lanes lanes_all(double value) {
    double lane[LANES];
    for (size_t k = 0; k < LANES; k++) lane[k] = value;
    return lanes_of(lane);
}

LANES_INLINE Lanes lanes_sqrt(Lanes x) {
#if __has_builtin(__builtin_elementwise_sqrt)
    return __builtin_elementwise_sqrt(x);
#else
    double lane[LANES];
    memcpy(lane, &x, sizeof lane);
    for (size_t k = 0; k < LANES; k++) lane[k] = sqrt(lane[k]);
    return lanes_of(lane);
#endif
}

LANES_INLINE Lanes lanes_fabs(Lanes x) {
    double lane[LANES];
    memcpy(lane, &x, sizeof lane);
    for (size_t k = 0; k < LANES; k++) lane[k] = fabs(lane[k]);
    return lanes_of(lane);
}

/* Takes `count` numbers from as many places as there are lanes, each `stride` from the one before. */
LANES_INLINE void lanes_gather(Lanes to[], const double *const from[LANES], size_t stride, size_t count) {
    for (size_t i = 0; i < count; i++) {
        double lane[LANES];
        for (size_t k = 0; k < LANES; k++) lane[k] = from[k][i * stride];
        to[i] = lanes_of(lane);
    }
}

/* Takes or puts back `count` numbers that stand LOOP_BLOCK side by side. */
LANES_INLINE void lanes_load(Lanes to[], const double from[], size_t count) {
    for (size_t i = 0; i < count; i++) to[i] = lanes_of(&from[i * LOOP_BLOCK]);
}
LANES_INLINE void lanes_store(double to[], const Lanes from[], size_t count) {
    for (size_t i = 0; i < count; i++) memcpy(&to[i * LOOP_BLOCK], &from[i], sizeof from[i]);
}

#endif
