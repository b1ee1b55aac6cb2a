/*
 * stepping.c - fixed steps to wherever the importer wants to be, for plant.c and loop.c.
 *
 * Steps end at the grid k h, so that communication steps of whole multiples of h give the bits of the simulation
 * loop. A communication point inside a step cuts it in two.
 */
static int fmu_begin(fmu_core *fmu) {
  springline_state state;
  const int status = springline_start(&fmu->controller, &state);
  if (status == SPRINGLINE_OK) fmu_put_state(fmu->now.values + FMU_AT_STATE, &state);
#if FMU_MEMORY > 0
  fmu_put_memory(fmu->now.values + FMU_AT_MEMORY, &springline_initial_memory);
#endif
  return status;
}

/* One step of the integrator, or a part of one. */
static int fmu_go(fmu_core *fmu, const fmu_place *to) {
  const fmu_state *now = &fmu->now;
  double *x = fmu->now.values + FMU_AT_STATE, next[FMU_STATES + FMU_MEMORY]; /* the controller's behind the plant's */
  const int whole = !now->between && !to->between;
  fmu_interval interval;
  int status, i;
  interval.length = whole ? FMU_GRID : to->time - now->time;
  for (i = 0; i < SPRINGLINE_BASE_NODES; i++) {
    const double node = springline_base_nodes[i];
    interval.t[i] = whole ? fmu_grid_time(now->step, node) : now->time + node * interval.length;
    if (node >= 1.0) interval.t[i] = to->time;
  }
  memcpy(next, x, sizeof next);
  status = fmu_move(fmu, &interval, next);
  if (status != SPRINGLINE_OK) return status;
  for (i = 0; i < FMU_STATES + FMU_MEMORY; i++) {
    if (!(sl_fabs(next[i]) <= FMU_BOUND)) return SPRINGLINE_DIVERGED;
  }
  memcpy(x, next, sizeof next);
  fmu_arrive(&fmu->now, to);
  return SPRINGLINE_OK;
}

static int fmu_advance(fmu_core *fmu, const fmu_place *to) {
  int status = SPRINGLINE_OK;
  while (status == SPRINGLINE_OK && fmu->now.step < to->step) {
    const fmu_place grid = {fmu_grid_time(fmu->now.step + 1, 0.0), fmu->now.step + 1, 0};
    status = fmu_go(fmu, &grid);
  }
  if (status == SPRINGLINE_OK && fmu->now.time < to->time) status = fmu_go(fmu, to);
  return status;
}
