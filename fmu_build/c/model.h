/* Functions generated from the scene's equations (model.c); supervessel/equations.py says what they compute.
   Each reads its arguments through arg, writes its results through res and returns 0. iw and w are work arrays of
   WORK_INT and WORK_REAL elements; mem is 0.

   Arguments and results, with their counts; axes are body axes:
     p [INPUT_P_COUNT]    inputs that shape the composite, directions scaled
     k [INPUT_K_COUNT]    motion at contact: m/s, rad/s
     u [INPUT_U_COUNT]    torques, N.m, forces, N, and flows, kg/s
     x [STATE_COUNT]      attitude w, x, y, z; angular velocity, rad/s; momenta of wheels, N.m.s
     z [STATE_COUNT]      states of model exchange: x, or angular momentum, N.m.s, in place of angular velocity
     c, d [COMPOSITE_COUNT]  composites
     a [AXES_COUNT]       principal moments and axes
     e [2]                estimated error of the last communication step, and bound of the error, rad
     b [3 or 4]           bound of the error: angle, rad; of the rate, energy norm, J^(1/2), and length, rad/s; in a field
                          of gravity of the place within a communication step, over the distance
     s [4]                a sub-step: its size, s; one more than its order, 0: free; its error estimated, rad and rad/s
     y [OUTPUT_COUNT]     outputs
     omega, momentum [3]  rad/s, N.m.s; as arguments of changes, but for dH, with momenta of wheels behind them,
                          [RATE_COUNT]
     h, t                 times, s
   A small change of a quantity has d before its name, a weight on it w. */
#ifndef MODEL_H
#define MODEL_H

int composite(const double **arg, double **res, int *iw, double *w, int mem);         /* p -> c */
int axes(const double **arg, double **res, int *iw, double *w, int mem);              /* c -> a */
int ode(const double **arg, double **res, int *iw, double *w, int mem);               /* z, u, c -> rate of z */
int outputs(const double **arg, double **res, int *iw, double *w, int mem);           /* x, u, c, a, e -> y */
int composite_forward(const double **arg, double **res, int *iw, double *w, int mem); /* p, dp -> dc */
int composite_reverse(const double **arg, double **res, int *iw, double *w, int mem); /* p, wc -> wp */

/* z, u, c, a, dz, du, dc -> d rate, dy; z are the FMU's states: x, or attitude and momentum */
int response_forward(const double **arg, double **res, int *iw, double *w, int mem);

/* z, u, c, a, w rate, wy -> wz, wu, wc */
int response_reverse(const double **arg, double **res, int *iw, double *w, int mem);

/* Of these a scene has those that its changes need. */
int momentum_of(const double **arg, double **res, int *iw, double *w, int mem);       /* omega, c -> momentum */
int momentum_of_forward(const double **arg, double **res, int *iw, double *w, int mem);
int momentum_of_reverse(const double **arg, double **res, int *iw, double *w, int mem);
int rate_of_momentum(const double **arg, double **res, int *iw, double *w, int mem);  /* momentum, c -> omega */
int keep_momentum(const double **arg, double **res, int *iw, double *w, int mem);     /* omega, c, d -> omega */
int keep_momentum_forward(const double **arg, double **res, int *iw, double *w, int mem);
int keep_momentum_reverse(const double **arg, double **res, int *iw, double *w, int mem);
int contact_momentum(const double **arg, double **res, int *iw, double *w, int mem);  /* p, k -> momentum */
int contact_momentum_forward(const double **arg, double **res, int *iw, double *w, int mem);
int contact_momentum_reverse(const double **arg, double **res, int *iw, double *w, int mem);
int docked_rate(const double **arg, double **res, int *iw, double *w, int mem);       /* omega, momentum, d -> omega */
int docked_rate_forward(const double **arg, double **res, int *iw, double *w, int mem);
int docked_rate_reverse(const double **arg, double **res, int *iw, double *w, int mem);

/* Of these a scene has those that its outputs need, see hand_over.h: x, omega, c, c, c, c, velocity -> what is added */
int handed_over(const double **arg, double **res, int *iw, double *w, int mem);
int handed_over_forward(const double **arg, double **res, int *iw, double *w, int mem);
int handed_over_reverse(const double **arg, double **res, int *iw, double *w, int mem);
int contact_velocity(const double **arg, double **res, int *iw, double *w, int mem);  /* p, k -> m/s */
int contact_velocity_forward(const double **arg, double **res, int *iw, double *w, int mem);
int contact_velocity_reverse(const double **arg, double **res, int *iw, double *w, int mem);

/* Of these a scene has those that its propagator uses. */
int fastest_square(const double **arg, double **res, int *iw, double *w, int mem);    /* x, u, c -> rad2/s2 */
int step(const double **arg, double **res, int *iw, double *w, int mem);              /* x, u, c, h -> x, error */
int by_torque(const double **arg, double **res, int *iw, double *w, int mem);         /* u, c -> rad/s2 */
int damping(const double **arg, double **res, int *iw, double *w, int mem);           /* u, c -> 1/s, column by column */
int held(const double **arg, double **res, int *iw, double *w, int mem);              /* x, u, c -> see taylor_series.h */
int rounding(const double **arg, double **res, int *iw, double *w, int mem);          /* x, u, c, h -> rad */
int bound_step(const double **arg, double **res, int *iw, double *w, int mem);        /* x, u, c, a, s, b -> b */
int bound_kept_rate(const double **arg, double **res, int *iw, double *w, int mem);   /* b[1], c, d -> b[1] */
int bound_kept_momentum(const double **arg, double **res, int *iw, double *w, int mem); /* b[1], c, d, omega, omega -> b[1] */
int free_phase(const double **arg, double **res, int *iw, double *w, int mem);        /* x, a, t -> rad */
int free_start(const double **arg, double **res, int *iw, double *w, int mem);        /* x, a, t, share -> v, k */
int free_double(const double **arg, double **res, int *iw, double *w, int mem);       /* v, k -> v */
int free_finish(const double **arg, double **res, int *iw, double *w, int mem);       /* x, a, t, v, k -> x */
int free_constants(const double **arg, double **res, int *iw, double *w, int mem);    /* x, a, scale -> k */
int free_at(const double **arg, double **res, int *iw, double *w, int mem);           /* k, t -> x */

/* Of these a scene has those whose composite is a loop; see kernels in supervessel/composite/chain.py. */
int loop_hang_forward(const double **arg, double **res, int *iw, double *w, int mem);
int loop_hang_reverse(const double **arg, double **res, int *iw, double *w, int mem);
int loop_hang_inside_forward(const double **arg, double **res, int *iw, double *w, int mem);
int loop_hang_inside_reverse(const double **arg, double **res, int *iw, double *w, int mem);
int loop_fixed_forward(const double **arg, double **res, int *iw, double *w, int mem);
int loop_fixed_reverse(const double **arg, double **res, int *iw, double *w, int mem);
int loop_scaled_forward(const double **arg, double **res, int *iw, double *w, int mem);
int loop_scaled_reverse(const double **arg, double **res, int *iw, double *w, int mem);
int loop_free_forward(const double **arg, double **res, int *iw, double *w, int mem);
int loop_free_reverse(const double **arg, double **res, int *iw, double *w, int mem);
int loop_diagonal_forward(const double **arg, double **res, int *iw, double *w, int mem);
int loop_diagonal_reverse(const double **arg, double **res, int *iw, double *w, int mem);
int loop_own_fixed_forward(const double **arg, double **res, int *iw, double *w, int mem);
int loop_own_fixed_reverse(const double **arg, double **res, int *iw, double *w, int mem);
int loop_own_scaled_forward(const double **arg, double **res, int *iw, double *w, int mem);
int loop_own_scaled_reverse(const double **arg, double **res, int *iw, double *w, int mem);
int loop_own_free_forward(const double **arg, double **res, int *iw, double *w, int mem);
int loop_own_free_reverse(const double **arg, double **res, int *iw, double *w, int mem);
int loop_weigh_forward(const double **arg, double **res, int *iw, double *w, int mem);
int loop_weigh_reverse(const double **arg, double **res, int *iw, double *w, int mem);
int loop_middle(const double **arg, double **res, int *iw, double *w, int mem);       /* sum -> middle */
int loop_middle_forward(const double **arg, double **res, int *iw, double *w, int mem);
int loop_middle_reverse(const double **arg, double **res, int *iw, double *w, int mem);
int loop_add_forward(const double **arg, double **res, int *iw, double *w, int mem);
int loop_add_reverse(const double **arg, double **res, int *iw, double *w, int mem);
int loop_finish(const double **arg, double **res, int *iw, double *w, int mem);       /* sum, first, middle, inertia -> c */
int loop_finish_forward(const double **arg, double **res, int *iw, double *w, int mem);
int loop_finish_reverse(const double **arg, double **res, int *iw, double *w, int mem);

#endif
