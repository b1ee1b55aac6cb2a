/* The controller against its plant: samples of 1 ms, plant steps of 0.1 ms. Prints a trajectory as CSV.
 * Usage: main [seconds = 1] */
#include <stdio.h>
#include <stdlib.h>

#include "springline.h"

enum { STEPS_PER_SAMPLE = 10, SAMPLES_PER_ROW = 10 };

static const springline_real STEP = 1e-4{{f}};

/* Time of half plant step j; never accumulated. */
static springline_real half_step_time(long j) { return (0.5{{f}} * (springline_real)j) * STEP; }

static void print_row(springline_real t, const springline_reference *reference, const springline_state *state,
                      const springline_command *command) {
  printf("%.{{digits}}g", (double)t);
{{print_fields}}
  printf("\n");
}

int main(int argc, char **argv) {
  const long samples = (argc > 1 ? strtol(argv[1], NULL, 10) : 1L) * 1000L;
  springline_controller controller;
  springline_state state;
  springline_measurement measurement;
  springline_reference reference;
  springline_command command;
  springline_base base[3];
  long k;
  int i, j;
  int status = springline_init(&controller, &springline_default_config);
  if (status == SPRINGLINE_OK) status = springline_start(&controller, &state);
{{table_warning}}  printf("{{csv_header}}\n");
  for (k = 0; k <= samples && status == SPRINGLINE_OK; k++) {
    const long first = 2L * STEPS_PER_SAMPLE * k; /* in half steps */
    status = springline_signals(&controller, half_step_time(first), &reference, &base[0]);
    if (status != SPRINGLINE_OK) break;
{{measure}}
    status = springline_step(&controller, &reference, &measurement, &command, NULL);
    if (status != SPRINGLINE_OK) break;
    if (k % SAMPLES_PER_ROW == 0) print_row(half_step_time(first), &reference, &state, &command);
    for (j = 0; j < STEPS_PER_SAMPLE && status == SPRINGLINE_OK; j++) {
      for (i = 0; i < 3; i++) {
        status = springline_signals(&controller, half_step_time(first + 2L * j + i), &reference, &base[i]);
        if (status != SPRINGLINE_OK) break;
      }
      if (status == SPRINGLINE_OK) status = springline_plant_step(&controller, &state, &command, base, STEP);
    }
  }
  if (status != SPRINGLINE_OK) {
    fprintf(stderr, "main: %s\n", springline_status_text(status));
    return 1;
  }
  return 0;
}
