/*
 * simulate.h - the one interface between the compiled loop and whoever drives it.
 *
 * One call simulates runs `first` .. `last`-1 of a batch. Calls share nothing that is written but their own rows, so
 * threads may each take a range. SI units; arrays are row-major, one row a run.
 */
#ifndef SL_SIMULATE_H
#define SL_SIMULATE_H

#include <stdint.h>

#include "sl_tables.h"

typedef struct {
  int64_t first, last;          /* the runs of this call */
  int64_t steps;                /* N, number of steps of every run */
  double start_time;            /* s */
  double step;                  /* h, s */
  double bound;                 /* a run stops when any |x_i| leaves it */
  int64_t hold;                 /* sampled control: steps per sample, >= 1; continuous control ignores it */
  int64_t output_every;         /* a trajectory row every so many steps, and at the end; 0: no trajectory */
  double response_band;         /* fraction of |e_i(0)|, 0 where response_error counts */
  double settling_band;         /* fraction of |e_i(0)|, 0 where settling_error counts */
  double response_error;        /* |e_i|, SI */
  double settling_error;        /* |e_i|, SI */
  const double *parameters;     /* runs x SL_NP */
  const sl_table *tables;       /* SL_NTABLES tables */
  double *metrics;              /* runs x SL_NMETRICS */
  double *final_state;          /* runs x SL_NX */
  double *end_time;             /* runs, s: time of the final state */
  int32_t *status;              /* runs, enum sl_status */
  int32_t *quantity;            /* runs, what left its bound: its place in a trajectory row, t not counted, or -1 */
  double *trajectory;           /* runs x rows x SL_NCOLUMNS, or NULL; a stopped run leaves its later rows untouched */
  int64_t *rows;                /* runs, trajectory rows written, or NULL */
  int64_t capacity;             /* rows that `trajectory` has room for, per run */
  volatile int64_t *progress;   /* steps x runs done so far are added here, or NULL */
  const volatile int32_t *stop; /* nonzero ends the call early, or NULL */
} sl_job;

enum sl_status {
  SL_OK = 0,
  SL_DIVERGED = 1,      /* the state, or what the control computed from it, left the finite numbers */
  SL_OUT_OF_BOUNDS = 2, /* the state left the bound of the job */
  SL_STOPPED = 3,       /* the caller asked to stop */
  SL_STATUSES
};

#endif
