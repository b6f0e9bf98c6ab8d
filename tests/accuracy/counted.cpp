/* Runs fmu_build/c/taylor_series.c with numbers that count what is done to them: slow operations as five. */
#include <math.h>
#include <stddef.h>

static long operations;

struct Counted {
    double value;
    Counted() = default;
    Counted(double v) : value(v) {}
};

static Counted did(double value, long count) {
    operations += count;
    return Counted(value);
}

static Counted operator+(Counted a, Counted b) { return did(a.value + b.value, 1); }
static Counted operator-(Counted a, Counted b) { return did(a.value - b.value, 1); }
static Counted operator*(Counted a, Counted b) { return did(a.value * b.value, 1); }
static Counted operator/(Counted a, Counted b) { return did(a.value / b.value, 5); }
static Counted operator-(Counted a) { return did(-a.value, 1); }
static Counted &operator+=(Counted &a, Counted b) { return a = a + b; }
static bool operator>(Counted a, Counted b) { return a.value > b.value; }
static Counted sqrt(Counted a) { return did(::sqrt(a.value), 5); }

#define double Counted
#include "taylor_series.c"

/* Returns what a sub-step takes. */
extern "C" __attribute__((visibility("default"))) long counted(int order) {
    static Series series;
    series.order = order;
    operations = 0;
    const Counted x[7] = {1.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3}, push[3] = {0.1, 0.2, 0.3};
    const Counted map[12] = {0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
    Counted next[7], rest[3] = {0.0, 0.0, 0.0};
#if FIELD
    const Counted field[6] = {1.0, 2.0, 3.0, 0.1, -0.2, 0.3}, gradient[18] = {0.1, -0.2, 0.3};
    Counted moved[6];
    series.field = field;
    series.gradient = gradient;
#endif
    taylor_series(x, push, map, 0.1, &series);
    taylor_sum(&series, x, map, 1.0, next, rest);
#if FIELD
    taylor_sum_field(&series, map, 1.0, next, moved);
#endif
    return operations;
}
