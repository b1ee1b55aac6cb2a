/* The smallest controller: what stays in flash when nothing but the control step is used. */
#include "springline.h"

springline_controller controller;
volatile springline_reference reference_in;
volatile springline_measurement measurement_in;
volatile springline_command command_out;

int main(void) {
  int status = springline_init(&controller, &springline_default_config);
  for (;;) {
    const springline_reference reference = reference_in;
    const springline_measurement measurement = measurement_in;
    springline_command command;
    status |= springline_step(&controller, &reference, &measurement, &command, 0);
    command_out = command;
    if (status != SPRINGLINE_OK) return status;
  }
}
