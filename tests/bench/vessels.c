/* Loads the generated C of a scene, compiled with its functions visible, and times its composite beside a plain RK4
   step.

   vessels LIBRARY FUNCTION INPUTS RESULTS WORK REPEATS < inputs
   Prints "nanoseconds ratio" of one evaluation, medians over short rounds, then the results. Inputs change from
   one evaluation to the next, by 1e-9. */
#include <dlfcn.h>

#include "plain.h"

enum { ROUNDS = 51, PLAIN_STEPS = 2000 };

typedef int Function(const double **arg, double **res, int *iw, double *w, int mem);

static double *numbers(size_t count) {
    double *made = calloc(count ? count : 1, sizeof *made);
    if (!made) exit(1);
    return made;
}

int main(int count, char **words) {
    if (count != 7) return 2;
    void *library = dlopen(words[1], RTLD_NOW);
    if (!library) {
        fprintf(stderr, "%s\n", dlerror());
        return 1;
    }
    Function *function;
    *(void **)&function = dlsym(library, words[2]);
    if (!function) return 1;
    const size_t inputs = strtoul(words[3], NULL, 10), results = strtoul(words[4], NULL, 10);
    const long repeats = strtol(words[6], NULL, 10);
    double *p = numbers(inputs), *q = numbers(inputs), *c = numbers(results);
    double *w = numbers(strtoul(words[5], NULL, 10));
    for (size_t i = 0; i < inputs; i++) {
        if (scanf("%lf", &p[i]) != 1) return 1;
        q[i] = p[i] * (1.0 + 1e-9);
    }
    const double *arg[16] = {p};
    double *res[16] = {c}, sink = 0.0;
    static double taken[ROUNDS], ratio[ROUNDS];
    for (int round = 0; round < ROUNDS; round++) {
        const double plain = time_plain(PLAIN_STEPS, &sink), begun = now();
        for (long i = 0; i < repeats; i++) {
            arg[0] = i % 2 ? q : p;
            function(arg, res, NULL, w, 0);
            sink += c[0];
        }
        taken[round] = 1e9 * (now() - begun) / (double)repeats;
        ratio[round] = taken[round] / plain;
    }
    arg[0] = p;
    function(arg, res, NULL, w, 0);
    printf("%.2f %.4f", median(taken, ROUNDS), median(ratio, ROUNDS));
    for (size_t i = 0; i < results; i++) printf(" %.17g", c[i]);
    printf("\n");
    return isfinite(sink) ? 0 : 1;
}
