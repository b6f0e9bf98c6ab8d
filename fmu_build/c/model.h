/* Functions generated from the scene's equations (model.c); see supervessel/equations.py for what they compute.
   Each reads its arguments through arg, writes its results through res and returns 0. */
#ifndef MODEL_H
#define MODEL_H

int composite(const double **arg, double **res, int *iw, double *w, int mem);     /* p -> c */
int longest_step(const double **arg, double **res, int *iw, double *w, int mem);  /* x, u, c -> h_max */
int step(const double **arg, double **res, int *iw, double *w, int mem);          /* x, u, c, h -> x */
int outputs(const double **arg, double **res, int *iw, double *w, int mem);       /* x, u, c -> y */

#endif
