/* plant.c - the arm as a part of an FMU: its state under commands that are held over each communication step. */

static int fmu_evaluate(fmu_core *fmu) {
#if FMU_BASE_IS_INPUT
  (void)fmu; /* the state is the output */
  return SPRINGLINE_OK;
#else
  springline_reference reference;
  springline_base base;
  const int status = fmu_surroundings(fmu, fmu->now.time, &reference, &base);
  if (status == SPRINGLINE_OK) fmu_put_base(fmu->now.values + FMU_AT_BASE, &base);
  return status;
#endif
}

static int fmu_move(fmu_core *fmu, const fmu_interval *interval, double *x) {
  springline_reference reference;
  springline_base base[3];
  springline_command command;
  springline_state state;
  int status = SPRINGLINE_OK, i;
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
