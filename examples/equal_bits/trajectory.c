/*
 * The trajectory of controllers/reproducible_chatter, by the exported C: every column whole, one after the other, as
 * little-endian doubles. Their SHA-256 is the one that `springline run controllers/reproducible_chatter --hash` prints.
 */
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "sl_math.h"
#include "springline.h"

#ifndef SAMPLES
#define SAMPLES 1000000L
#endif

enum { SAMPLES_PER_ROW = 100, ROWS = SAMPLES / SAMPLES_PER_ROW + 1, COLUMNS = 24 };

static const double STEP = 1e-3;

static double table[COLUMNS][ROWS];

/* A row as the table of a run has it. The base is at rest, so the ship's axes and the earth's are the same. */
static void note(long row, double t, const springline_state *state, const springline_reference *reference,
                 const springline_diagnostics *why, const springline_command *command, const springline_memory *z,
                 const springline_base *base) {
  /* The exported C has no tip: it is the end of the rod of 1 m. */
  const double x = sl_cos(state->q1_joint1), y = sl_sin(state->q1_joint1);
  const double dx = -y * state->dq1_joint1, dy = x * state->dq1_joint1;
  const double values[COLUMNS] = {
      t, state->q1_joint1, state->dq1_joint1, reference->q1d_joint1, why->e_joint1, why->sigma_joint1,
      command->U_joint1, z->z_nu_joint1, base->y_r1, base->theta_1z, base->theta_1x, base->disturbance_joint1,
      x, y, 0.0, x, y, 0.0, dx, dy, 0.0, dx, dy, 0.0};
  int column;
  for (column = 0; column < COLUMNS; column++) table[column][row] = values[column];
}

static int simulate(void) {
  springline_controller controller;
  springline_state state;
  springline_reference reference;
  springline_measurement measurement;
  springline_command command;
  springline_diagnostics why;
  springline_base base[SPRINGLINE_BASE_NODES];
  long k;
  int i, status = springline_init(&controller, &springline_default_config);
  if (status == SPRINGLINE_OK) status = springline_start(&controller, &state);
  for (k = 0; k <= SAMPLES && status == SPRINGLINE_OK; k++) {
    const springline_memory z = controller.z; /* what the command is computed from */
    for (i = SPRINGLINE_BASE_NODES - 1; i >= 0 && status == SPRINGLINE_OK; i--) { /* the reference is that at 0, last */
      status = springline_signals(&controller, ((double)k + springline_base_nodes[i]) * STEP, &reference, &base[i]);
    }
    if (status == SPRINGLINE_OK) status = springline_measure(&controller, &state, &measurement);
    if (status == SPRINGLINE_OK) status = springline_step(&controller, &reference, &measurement, &command, &why);
    if (status == SPRINGLINE_OK && k % SAMPLES_PER_ROW == 0) {
      note(k / SAMPLES_PER_ROW, (double)k * STEP, &state, &reference, &why, &command, &z, &base[0]);
    }
    if (status == SPRINGLINE_OK) status = springline_plant_step(&controller, &state, &command, base, STEP);
  }
  return status;
}

static int write_doubles(const double *values, long count) {
  long k;
  int i;
  for (k = 0; k < count; k++) {
    unsigned char bytes[8];
    uint64_t word;
    memcpy(&word, &values[k], sizeof word);
    for (i = 0; i < 8; i++) bytes[i] = (unsigned char)(word >> 8 * i & 0xff);
    if (fwrite(bytes, sizeof bytes, 1, stdout) != 1) return 1;
  }
  return 0;
}

int main(void) {
  const int status = simulate();
  if (status != SPRINGLINE_OK) {
    fprintf(stderr, "trajectory: %s\n", springline_status_text(status));
    return 1;
  }
  return write_doubles(table[0], (long)COLUMNS * ROWS) || fflush(stdout) != 0;
}
