/*
 * loop.c - controller and arm together as one FMU, in the order of the simulation loop and so with its bits.
 *
 * FMU_HOLD > 0: the command is sampled every FMU_HOLD steps and held; 0: the law is part of the differential equation.
 */
enum { FMU_CURRENT = 2 * FMU_JOINTS }; /* the diagnostics e and sigma come first, and are never held */

static int fmu_control(fmu_core *fmu, const springline_reference *reference, const double *x,
                       springline_command *command, springline_diagnostics *diagnostics) {
  springline_measurement measurement;
  fmu_measure(x, &measurement);
  return springline_step(&fmu->controller, reference, &measurement, command, diagnostics);
}

static int fmu_evaluate(fmu_core *fmu) {
  double *v = fmu->now.values, seen[FMU_DIAGNOSTICS];
#if FMU_HOLD > 0
  const int sampling = !fmu->now.between && fmu->now.step % FMU_HOLD == 0;
#else
  const int sampling = 1;
#endif
  springline_reference reference;
  springline_base base;
  springline_command command;
  springline_diagnostics diagnostics;
  int status = fmu_surroundings(fmu, fmu->now.time, &reference, &base);
  if (status == SPRINGLINE_OK) status = fmu_control(fmu, &reference, v + FMU_AT_STATE, &command, &diagnostics);
  if (status != SPRINGLINE_OK) return status;
  fmu_put_reference(v + FMU_AT_REFERENCE, &reference);
#if !FMU_BASE_IS_INPUT
  fmu_put_base(v + FMU_AT_BASE, &base);
#endif
  fmu_put_diagnostics(seen, &diagnostics);
  memcpy(v + FMU_AT_DIAGNOSTICS, seen, (sampling ? FMU_DIAGNOSTICS : FMU_CURRENT) * sizeof *seen);
  if (sampling) fmu_put_command(v + FMU_AT_COMMAND, &command);
  return SPRINGLINE_OK;
}

#if FMU_HOLD > 0

static int fmu_move(fmu_core *fmu, const fmu_interval *interval, double *x) {
  springline_reference reference;
  springline_base base[3];
  springline_command command;
  springline_state state;
  int status = fmu_evaluate(fmu), i; /* a new sample where one is due */
  for (i = 0; i < 3 && status == SPRINGLINE_OK; i++) {
    status = fmu_surroundings(fmu, interval->t[i], &reference, &base[i]);
  }
  if (status != SPRINGLINE_OK) return status;
  fmu_get_command(fmu->now.values + FMU_AT_COMMAND, &command);
  fmu_get_state(x, &state);
  status = springline_plant_step(&fmu->controller, &state, &command, base, interval->length);
  fmu_put_state(x, &state);
  return status;
}

#else

/* One classical Runge-Kutta step, operation by operation that of the simulation loop. */
static int fmu_move(fmu_core *fmu, const fmu_interval *interval, double *x) {
  static const double node[4] = {0.0, 0.5, 0.5, 1.0}, weight[4] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
  static const int when[4] = {0, 1, 1, 2};
  const double h = interval->length;
  springline_reference reference[3];
  springline_base base[3];
  double start[FMU_STATES], at[FMU_STATES], slope[FMU_STATES];
  int status = SPRINGLINE_OK, stage, i;
  for (i = 0; i < 3 && status == SPRINGLINE_OK; i++) {
    status = fmu_surroundings(fmu, interval->t[i], &reference[i], &base[i]);
  }
  memcpy(start, x, sizeof start);
  memcpy(at, x, sizeof at);
  for (stage = 0; stage < 4 && status == SPRINGLINE_OK; stage++) {
    const double advance = stage < 3 ? node[stage + 1] * h : 0.0, gain = weight[stage] * h;
    springline_command command;
    springline_diagnostics diagnostics;
    status = fmu_control(fmu, &reference[when[stage]], at, &command, &diagnostics);
    if (status != SPRINGLINE_OK) return status;
    fmu_slope(fmu->now.values + FMU_AT_PARAMETERS, &base[when[stage]], at, &command, slope);
    for (i = 0; i < FMU_STATES; i++) {
      x[i] = x[i] + gain * slope[i];
      at[i] = start[i] + advance * slope[i];
    }
  }
  return status;
}

#endif
