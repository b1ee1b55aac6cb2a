/* Time of one control step on this machine: the best of many rounds, with inputs that change from step to step. */
#include <stdio.h>
#include <time.h>

#include "springline.h"

enum { ROUNDS = 50, STEPS = 20000 };

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

int main(void) {
  springline_controller controller;
  springline_reference reference;
  springline_base base;
  springline_state arm;
  springline_command command;
  double best = 1e9;
  int round, k, status = springline_init(&controller, &springline_default_config);
  status |= springline_start(&controller, &arm);
  status |= springline_signals(&controller, 0, &reference, &base);
  for (round = 0; round < ROUNDS; round++) {
    springline_measurement measurement = {0};
    double start;
    measurement.q1_lift = arm.q1_lift;
    measurement.q1_rotation = arm.q1_rotation;
    start = now();
    for (k = 0; k < STEPS; k++) {
      status |= springline_step(&controller, &reference, &measurement, &command, NULL);
      measurement.q1_rotation += 1e-9 * command.U_rotation; /* the next step needs this one */
    }
    if (now() - start < best) best = now() - start;
  }
  printf("  control step %.0f ns\n", best / STEPS);
  return status;
}
