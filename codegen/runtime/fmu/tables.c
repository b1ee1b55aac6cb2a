/* tables.c - signals that come from a scenario's tables: cubics on uniform knots, as the simulation loop reads them. */

/* Table data at time t: per table tau, s from the knot, then four coefficients a channel. */
static void fmu_table_data(double t, double *d) {
  int i, c;
  for (i = 0; i < FMU_TABLES; i++) {
    const fmu_table *table = &fmu_tables[i];
    const double span = (double)table->intervals * table->dt;
    const double *coefficients;
    double since = t - table->t0;
    int64_t k;
    if (table->periodic) since = since - span * sl_floor(since / span);
    since = sl_fmin(sl_fmax(since, 0.0), span);
    k = (int64_t)sl_floor(since / table->dt);
    if (k >= table->intervals) k = table->intervals - 1;
    coefficients = table->coefficients + 4 * table->channels * k;
    *d++ = since - (double)k * table->dt;
    for (c = 0; c < 4 * table->channels; c++) *d++ = coefficients[c];
  }
}
