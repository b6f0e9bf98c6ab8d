/* Functions generated from the scene's equations (model.c); see supervessel/equations.py for what they compute.
   Each reads its arguments through arg, writes its results through res and returns 0. */
#ifndef MODEL_H
#define MODEL_H

int composite(const double **arg, double **res, int *iw, double *w, int mem);         /* p -> c */
int ode(const double **arg, double **res, int *iw, double *w, int mem);               /* x, u, c -> rate of x */
int fastest_square(const double **arg, double **res, int *iw, double *w, int mem);    /* x, u, c -> rad2/s2 */
int step(const double **arg, double **res, int *iw, double *w, int mem);              /* x, u, c, h -> x */
int outputs(const double **arg, double **res, int *iw, double *w, int mem);           /* x, u, c -> y */
int composite_forward(const double **arg, double **res, int *iw, double *w, int mem); /* p, dp -> dc */
int composite_reverse(const double **arg, double **res, int *iw, double *w, int mem); /* p, wc -> wp */

/* x, u, c, dx, du, dc -> d rate, dy */
int response_forward(const double **arg, double **res, int *iw, double *w, int mem);

/* x, u, c, w rate, wy -> wx, wu, wc */
int response_reverse(const double **arg, double **res, int *iw, double *w, int mem);

#endif
