/* A controller in its smallest form: one second at 1 kHz, with a sensor that fails for three samples on the way. */
#include <math.h>
#include <stdio.h>

#include "springline.h"

int main(void) {
  springline_config config = springline_default_config;
  springline_controller controller;
  springline_state arm; /* stands for the machine */
  springline_base base;
  int k, j, faults = 0;

  config.fallback = SPRINGLINE_FALLBACK_LAST; /* hold the last good command while a sensor is out */
  if (springline_init(&controller, &config) != SPRINGLINE_OK) return 1;
  if (springline_start(&controller, &arm) != SPRINGLINE_OK) return 1;

  for (k = 0; k < 1000; k++) {
    springline_reference reference;
    springline_measurement measurement;
    springline_command command;
    springline_diagnostics diagnostics;
    int status = springline_signals(&controller, 1e-3 * k, &reference, &base);
    if (status != SPRINGLINE_OK) return 1;

    measurement.q1_lift = arm.q1_lift;
    measurement.q1_rotation = arm.q1_rotation;
    measurement.dq1_lift = arm.dq1_lift;
    measurement.dq1_rotation = arm.dq1_rotation;
    measurement.dq2_lift = arm.dq2_lift;
    measurement.dq2_rotation = arm.dq2_rotation;
    if (k >= 500 && k < 503) measurement.q1_lift = (double)NAN; /* the sensor is out */

    status = springline_step(&controller, &reference, &measurement, &command, &diagnostics);
    if (status != SPRINGLINE_OK) {
      printf("t = %.3f s: %s\n", 1e-3 * k, springline_status_text(status));
      faults++;
    }
    if (k % 100 == 0) {
      printf("t = %.3f s: e = %9.6f m %9.6f rad, U = %8.2f N %8.2f N m\n", 1e-3 * k, diagnostics.e_lift,
             diagnostics.e_rotation, command.U_lift, command.U_rotation);
    }
    for (j = 0; j < 10; j++) {
      if (springline_plant_step(&controller, &arm, &command, NULL, 1e-4) != SPRINGLINE_OK) return 1;
    }
  }
  return faults == 3 ? 0 : 1;
}
