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
  return status;
}

/* One step of the integrator, or a part of one. */
static int fmu_go(fmu_core *fmu, const fmu_place *to) {
  const fmu_state *now = &fmu->now;
  double *x = fmu->now.values + FMU_AT_STATE, next[FMU_STATES];
  fmu_interval interval = {{now->time, 0.0, to->time}, FMU_GRID};
  int status, i;
  if (now->between || to->between) {
    interval.length = to->time - now->time;
    interval.t[1] = now->time + 0.5 * interval.length;
  } else {
    interval.t[1] = fmu_grid_time(2 * now->step + 1);
  }
  memcpy(next, x, sizeof next);
  status = fmu_move(fmu, &interval, next);
  if (status != SPRINGLINE_OK) return status;
  for (i = 0; i < FMU_STATES; i++) {
    if (!(sl_fabs(next[i]) <= FMU_BOUND)) return SPRINGLINE_DIVERGED;
  }
  memcpy(x, next, sizeof next);
  fmu_arrive(&fmu->now, to);
  return SPRINGLINE_OK;
}

static int fmu_advance(fmu_core *fmu, const fmu_place *to) {
  int status = SPRINGLINE_OK;
  while (status == SPRINGLINE_OK && fmu->now.step < to->step) {
    const fmu_place grid = {fmu_grid_time(2 * (fmu->now.step + 1)), fmu->now.step + 1, 0};
    status = fmu_go(fmu, &grid);
  }
  if (status == SPRINGLINE_OK && fmu->now.time < to->time) status = fmu_go(fmu, to);
  return status;
}
