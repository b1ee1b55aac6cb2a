/*
 * stepping.h - fixed steps to wherever the importer wants to be, for plant.c and loop.c.
 *
 * Steps end at the grid start + k h, so that communication steps of whole multiples of h give the bits of the
 * simulation loop. A communication point inside a step cuts it in two.
 */
typedef struct {
  double t[3]; /* start, middle, end */
  double length;
} fmu_interval;

/* The state after one step; `x` is the state's block of values. */
static int fmu_move(fmu_instance *fmu, const fmu_interval *interval, double *x);

static int fmu_signals(const fmu_instance *fmu, double t, springline_reference *reference, springline_base *base);

/* Reference and base motion: the scenario's, or what the importer makes of the base. */
static int fmu_surroundings(const fmu_instance *fmu, double t, springline_reference *reference, springline_base *base) {
  const int status = fmu_signals(fmu, t, reference, base);
#if FMU_BASE_IS_INPUT
  fmu_get_base(fmu->now.values + FMU_AT_BASE, base);
#endif
  return status;
}

static int fmu_begin(fmu_instance *fmu) {
  springline_state state;
  const int status = springline_start(&fmu->controller, &state);
  if (status == SPRINGLINE_OK) fmu_put_state(fmu->now.values + FMU_AT_STATE, &state);
  return status;
}

static int fmu_go(fmu_instance *fmu, const fmu_interval *interval) {
  double *x = fmu->now.values + FMU_AT_STATE, next[FMU_STATES];
  int status, i;
  memcpy(next, x, sizeof next);
  status = fmu_move(fmu, interval, next);
  if (status != SPRINGLINE_OK) return status;
  for (i = 0; i < FMU_STATES; i++) {
    if (!(sl_fabs(next[i]) <= FMU_BOUND)) return SPRINGLINE_DIVERGED;
  }
  memcpy(x, next, sizeof next);
  return SPRINGLINE_OK;
}

static int fmu_advance(fmu_instance *fmu, double until) {
  fmu_state *now = &fmu->now;
  const double tolerance = fmu_tolerance(until);
  for (;;) {
    const double grid = fmu_grid_time(now, 2 * (now->step + 1));
    const int whole = grid <= until + tolerance;
    const double end = whole ? grid : until;
    fmu_interval interval = {{now->time, 0.0, end}, FMU_GRID};
    int status;
    if (!whole && end - now->time <= tolerance) return SPRINGLINE_OK;
    if (whole && !now->between) {
      interval.t[1] = fmu_grid_time(now, 2 * now->step + 1);
    } else {
      interval.length = end - now->time;
      interval.t[1] = now->time + 0.5 * interval.length;
    }
    status = fmu_go(fmu, &interval);
    if (status != SPRINGLINE_OK) return status;
    now->step += whole;
    now->between = !whole;
    now->time = end;
  }
}
