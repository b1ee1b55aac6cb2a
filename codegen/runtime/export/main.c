/* The controller against its plant: samples of {{period_text}}, plant steps of {{step_text}}. Prints a trajectory as CSV.
 * Usage: main [seconds = 1] */
#include <stdio.h>
#include <stdlib.h>

#include "springline.h"

enum { STEPS_PER_SAMPLE = {{steps_per_sample}}, SAMPLES_PER_ROW = {{samples_per_row}} };

static const springline_real STEP = {{step}}{{f}};

/* Time of plant step j, or of a part of the way to the next; never accumulated. */
static springline_real time_of(long j, springline_real part) { return ((springline_real)j + part) * STEP; }

static void print_row(
    springline_real t, const springline_reference *reference, const springline_state *state,
    const springline_command *command) {
  printf("%.{{digits}}g", (double)t);
{{print_fields}}
  printf("\n");
}

int main(int argc, char **argv) {
  const long samples = (argc > 1 ? strtol(argv[1], NULL, 10) : 1L) * {{samples_per_second}}L;
  springline_controller controller;
  springline_state state;
  springline_measurement measurement;
  springline_reference reference;
  springline_command command;
  springline_base base[SPRINGLINE_BASE_NODES];
  long k;
  int i, j;
  int status = springline_init(&controller, &springline_default_config);
  if (status == SPRINGLINE_OK) status = springline_start(&controller, &state);
{{table_warning}}  printf("{{csv_header}}\n");
  for (k = 0; k <= samples && status == SPRINGLINE_OK; k++) {
    const long first = STEPS_PER_SAMPLE * k; /* in plant steps */
    status = springline_signals(&controller, time_of(first, 0.0{{f}}), &reference, &base[0]);
    if (status == SPRINGLINE_OK) status = springline_measure(&controller, &state, &measurement);
    if (status != SPRINGLINE_OK) break;
    status = springline_step(&controller, &reference, &measurement, &command, NULL);
    if (status != SPRINGLINE_OK) break;
    if (k % SAMPLES_PER_ROW == 0) print_row(time_of(first, 0.0{{f}}), &reference, &state, &command);
    for (j = 0; j < STEPS_PER_SAMPLE && status == SPRINGLINE_OK; j++) {
      for (i = 0; i < SPRINGLINE_BASE_NODES && status == SPRINGLINE_OK; i++) {
        status = springline_signals(&controller, time_of(first + j, springline_base_nodes[i]), &reference, &base[i]);
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
