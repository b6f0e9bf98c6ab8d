/* The composite of a scene whose vessels' poses are given: the loop without the ports, on poses placed once. */
#include "vessel_loop.c"

#include "plain.h"

/* Returns the nanoseconds of one evaluation, beside which `plain` gets those of a plain RK4 step. */
double time_given(const double p[], double c[], double *w, long repeats, double *plain) {
    const Sources sources = {p, LOOP_HELD};
    Chain *now_at = (Chain *)w;
    double *res[] = {c}, sink = 0.0;
    *plain = time_plain(2000, &sink);
    put_together(p, now_at, w + LOOP_WORK);
    const double begun = now();
    for (long i = 0; i < repeats; i++) {
        sum_masses(sources, now_at);
        const double *sum[] = {now_at->sum};
        double *middle[] = {now_at->middle};
        loop_middle(sum, middle, NULL, w + LOOP_WORK, 0);
        sum_inertia(now_at);
        const double *whole[] = {now_at->sum, now_at->first, now_at->middle, now_at->inertia};
        loop_finish(whole, res, NULL, w + LOOP_WORK, 0);
    }
    return 1e9 * (now() - begun) / (double)repeats + 0.0 * sink;
}

/* The same of calls of two functions, one after the other. */
double time_calls(void (*first)(void *, void *), void (*second)(void *, void *), void *a, void *b, long repeats,
                  double *plain) {
    double sink = 0.0;
    *plain = time_plain(2000, &sink);
    const double begun = now();
    for (long i = 0; i < repeats; i++) {
        first(a, b);
        second(a, b);
    }
    return 1e9 * (now() - begun) / (double)repeats + 0.0 * sink;
}
