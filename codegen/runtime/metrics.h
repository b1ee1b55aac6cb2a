/*
 * metrics.h - folds: what metrics gather over the samples of a run, so that no trajectory need be kept.
 *
 * Which there are, and what becomes of them, stands in kernel.h, printed from the declarations (METRICS in
 * model/metrics.py). Samples are taken at the beginning of every step, and at the end.
 */
#ifndef SL_METRICS_H
#define SL_METRICS_H

#include "sl_lanes.h"

/* When a sample is taken, and which part of the run it lies in: one goes on where the sample before was in it too. */
typedef struct {
  double time; /* s */
  int run_goes_on;
  int half, half_goes_on;       /* the second half */
  int quarter, quarter_goes_on; /* the last quarter */
} sl_instant;

/* What is known of a run at its end. */
typedef struct {
  double start, duration, half; /* s; half is the length of its second half, had it gone on */
  double step;                  /* s, from sample to sample */
  double complete;              /* 1, or 0 for a run that stopped before its end */
} sl_span;

/* A fold of one sample more, x. */
static inline sl_v sl_largest(sl_v fold, sl_v x) { return slv_fmax(fold, x); }
static inline sl_v sl_smallest(sl_v fold, sl_v x) { return slv_fmin(fold, x); }
static inline sl_v sl_sum(sl_v fold, sl_v x) { return fold + x; }
static inline sl_v sl_variation(sl_v fold, sl_v x, sl_v before) { return fold + slv_fabs(x - before); }
static inline sl_v sl_first(sl_v fold, sl_m when, sl_v t) { return slv_select(when, slv_fmin(t, fold), fold); }
static inline sl_v sl_last(sl_v fold, sl_m when, sl_v t) { return slv_select(when, t, fold); }

/* Integral by the trapezoid rule, h apart, of what has this sum over the samples, and began and ended so. */
static inline double sl_integral(double sum, double first, double last, double h) {
  return h * (sum - 0.5 * (first + last));
}

static inline double sl_mean(double sum, double first, double last, double h, double duration) {
  return duration > 0.0 ? sl_integral(sum, first, last, h) / duration : last;
}

#endif
