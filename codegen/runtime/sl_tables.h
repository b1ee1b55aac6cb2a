/*
 * sl_tables.h - signals that come as tables: cubics on uniform knots, for the loop, exports and
 * FMUs alike.
 */
#ifndef SL_TABLES_H
#define SL_TABLES_H

#include <stdint.h>

#include "sl_math.h"

/* Knot k stands at t0 + k dt; coefficients[k][channel][4] belong to the cubic on interval k. */
typedef struct {
  double t0;                  /* s */
  double dt;                  /* s */
  int64_t intervals;          /* number of knot intervals */
  int64_t channels;           /* columns with data */
  int64_t periodic;           /* 1: t is wrapped into the table, 0: t is clamped to it */
  const double *coefficients; /* intervals x channels x 4, c0 + c1 tau + c2 tau^2 + c3 tau^3 */
} sl_table;

/* Data of the interval that holds t: per table tau, s from the knot, and four coefficients a
 * channel, into d[0], d[stride], ... */
static inline void sl_table_data(const sl_table *tables, int count, double t, double *d,
                                 int stride) {
  int i;
  for (i = 0; i < count; i++) {
    const sl_table *table = &tables[i];
    const double span = (double)table->intervals * table->dt;
    const double *coefficients;
    double since = t - table->t0;
    int64_t k, c;
    if (table->periodic) since = since - span * sl_floor(since / span);
    since = sl_fmin(sl_fmax(since, 0.0), span);
    k = (int64_t)sl_floor(since / table->dt);
    if (k >= table->intervals) k = table->intervals - 1;
    coefficients = table->coefficients + 4 * table->channels * k;
    *d = since - (double)k * table->dt;
    d += stride;
    for (c = 0; c < 4 * table->channels; c++, d += stride) *d = coefficients[c];
  }
}

#endif
