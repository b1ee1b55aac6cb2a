/*
 * controller.c - the control law as a part of an FMU: commands from references and measurements.
 *
 * The command belongs to the inputs of the same time. With a sample period it does so at the samples and is held in
 * between; importers that step from sample to sample see no difference. The states of a controller that has some are, at
 * a sample, those that its command is computed from; those after it are taken when time goes on.
 */
static int fmu_begin(fmu_core *fmu) {
#if FMU_MEMORY > 0
  fmu_put_memory(fmu->now.values + FMU_AT_MEMORY, &springline_initial_memory);
#else
  (void)fmu;
#endif
  return SPRINGLINE_OK;
}

/* A sample at the inputs that are held. fmu->controller has the states after it. */
static int fmu_sample(fmu_core *fmu) {
  double *v = fmu->now.values;
  springline_reference reference;
  springline_measurement measurement;
  springline_command command;
  springline_diagnostics diagnostics;
  int status;
  fmu_get_reference(v + FMU_AT_REFERENCE, &reference);
  fmu_get_measurement(v + FMU_AT_MEASUREMENT, &measurement);
#if FMU_MEMORY > 0
  fmu_get_memory(v + FMU_AT_MEMORY, &fmu->controller.z);
#endif
  status = springline_step(&fmu->controller, &reference, &measurement, &command, &diagnostics);
  if (status != SPRINGLINE_OK) return status;
  fmu_put_command(v + FMU_AT_COMMAND, &command);
  fmu_put_diagnostics(v + FMU_AT_DIAGNOSTICS, &diagnostics);
  return SPRINGLINE_OK;
}

static int fmu_evaluate(fmu_core *fmu) { return fmu->now.between ? SPRINGLINE_OK : fmu_sample(fmu); }

#if FMU_MEMORY > 0
/* Takes the states after the sample that was the last one. */
static void fmu_leave(fmu_core *fmu) { fmu_put_memory(fmu->now.values + FMU_AT_MEMORY, &fmu->controller.z); }
#endif

static int fmu_advance(fmu_core *fmu, const fmu_place *to) {
  /* Samples before the end of the step see the inputs that are held; the one at its end is fmu_evaluate's. */
  const int64_t on_the_way = to->step - fmu->now.step - (to->between ? 0 : 1);
  int status = fmu_evaluate(fmu); /* the command of a sample that was never asked for is held too */
#if FMU_MEMORY > 0
  int64_t k;
  if (status == SPRINGLINE_OK && !fmu->now.between && on_the_way >= 0) fmu_leave(fmu);
  for (k = 0; k < on_the_way && status == SPRINGLINE_OK; k++) {
    status = fmu_sample(fmu);
    if (status == SPRINGLINE_OK) fmu_leave(fmu);
  }
#else
  if (status == SPRINGLINE_OK && on_the_way > 0) status = fmu_sample(fmu);
#endif
  if (status == SPRINGLINE_OK) fmu_arrive(&fmu->now, to);
  return status;
}
