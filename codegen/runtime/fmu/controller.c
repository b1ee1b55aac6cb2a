/*
 * controller.c - the control law as a part of an FMU: commands from references and measurements.
 *
 * The command belongs to the inputs of the same time. With a sample period it does so at the samples and is held in
 * between; importers that step from sample to sample see no difference.
 */
static int fmu_begin(fmu_instance *fmu) {
  (void)fmu;
  return SPRINGLINE_OK;
}

static int fmu_sample(fmu_instance *fmu) {
  double *v = fmu->now.values;
  springline_reference reference;
  springline_measurement measurement;
  springline_command command;
  springline_diagnostics diagnostics;
  int status;
  fmu_get_reference(v + FMU_AT_REFERENCE, &reference);
  fmu_get_measurement(v + FMU_AT_MEASUREMENT, &measurement);
  status = springline_step(&fmu->controller, &reference, &measurement, &command, &diagnostics);
  if (status != SPRINGLINE_OK) return status;
  fmu_put_command(v + FMU_AT_COMMAND, &command);
  fmu_put_diagnostics(v + FMU_AT_DIAGNOSTICS, &diagnostics);
  return SPRINGLINE_OK;
}

static int fmu_evaluate(fmu_instance *fmu) { return fmu->now.between ? SPRINGLINE_OK : fmu_sample(fmu); }

static int fmu_advance(fmu_instance *fmu, double until) {
  fmu_state *now = &fmu->now;
  int status = fmu_evaluate(fmu); /* the command of a sample that was never asked for is held too */
  if (FMU_GRID > 0.0) {
    const int64_t before = now->step;
    const double tolerance = fmu_tolerance(until);
    int64_t on_the_way;
    while (fmu_grid_time(now, 2 * (now->step + 1)) <= until + tolerance) now->step++;
    now->between = until - fmu_grid_time(now, 2 * now->step) > tolerance;
    on_the_way = now->step - before - (now->between ? 0 : 1); /* samples before `until` see the inputs that are held */
    if (status == SPRINGLINE_OK && on_the_way > 0) status = fmu_sample(fmu);
  }
  if (status == SPRINGLINE_OK) now->time = until;
  return status;
}
