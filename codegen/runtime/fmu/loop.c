/*
 * loop.c - controller and arm together as one FMU, in the order of the simulation loop and so with its bits.
 *
 * FMU_HOLD > 0: the command is sampled every FMU_HOLD steps and held; 0: the law is part of the differential equation.
 *
 * The states of the controller stand behind the plant's; fmu->controller has a copy to work on. At a sample they are those
 * that its command is computed from, and those after it are taken when time goes on: until then its outputs may be asked
 * for again and again.
 */

/* The control at the state x. Where the controller has states, those after a sample go to `ahead`, which may be NULL. */
static int fmu_control(fmu_core *fmu, const springline_reference *reference, const double *x, double *ahead,
                       springline_command *command, springline_diagnostics *diagnostics) {
  springline_measurement measurement;
  springline_state state;
  int status;
  fmu_get_state(x, &state);
  status = springline_measure(&fmu->controller, &state, &measurement);
  if (status != SPRINGLINE_OK) return status;
#if FMU_MEMORY > 0
  fmu_get_memory(x + FMU_STATES, &fmu->controller.z);
#endif
  status = springline_step(&fmu->controller, reference, &measurement, command, diagnostics);
#if FMU_MEMORY > 0
  if (ahead != NULL && status == SPRINGLINE_OK) fmu_put_memory(ahead, &fmu->controller.z);
#else
  (void)ahead;
#endif
  return status;
}

/* The outputs of this time, and at a sample the controller's states after it. */
static int fmu_look(fmu_core *fmu, double *ahead) {
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
  if (status == SPRINGLINE_OK) status = fmu_control(fmu, &reference, v + FMU_AT_STATE, sampling ? ahead : NULL, &command, &diagnostics);
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

static int fmu_evaluate(fmu_core *fmu) { return fmu_look(fmu, NULL); }

#if FMU_HOLD > 0

static int fmu_move(fmu_core *fmu, const fmu_interval *interval, double *x) {
  springline_reference reference;
  springline_base base[SPRINGLINE_BASE_NODES];
  springline_command command;
  springline_state state;
  int status = fmu_look(fmu, x + FMU_STATES), i; /* a new sample where one is due */
  for (i = 0; i < SPRINGLINE_BASE_NODES && status == SPRINGLINE_OK; i++) {
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

static int fmu_move(fmu_core *fmu, const fmu_interval *interval, double *x) {
  springline_reference reference[SPRINGLINE_BASE_NODES];
  springline_base base[SPRINGLINE_BASE_NODES];
  double start[FMU_STATES + FMU_MEMORY];
  int status = SPRINGLINE_OK, i;
  for (i = 0; i < SPRINGLINE_BASE_NODES && status == SPRINGLINE_OK; i++) {
    status = fmu_surroundings(fmu, interval->t[i], &reference[i], &base[i]);
  }
  if (status != SPRINGLINE_OK) return status;
  memcpy(start, x, sizeof start);
  return fmu_closed_step(fmu, reference, base, start, x, interval->length);
}

#endif
