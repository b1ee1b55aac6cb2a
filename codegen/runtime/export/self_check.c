/*
 * Replays test_vectors.txt: every output must have the bits that are written there. A build that fails this has been
 * compiled with flags that change arithmetic, and does not compute what was tested. Retunes and resets a running
 * controller too.
 * Usage: self_check [test_vectors.txt]
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "springline.h"
#include "springline_model.h"
#include "{{math_header}}"

typedef {{bits_type}} bits;

enum { CONTROL_IN = {{control_in}}, CONTROL_OUT = {{control_out}}, COMMAND_OUT = {{command_out}}, MODEL_OUT = {{model_out}},
{{memory_enum}}       PLANT_IN = {{plant_in}}, PLANT_OUT = {{plant_out}}, LINE = 4096 };

static const char *const control_outputs[CONTROL_OUT] = { {{control_output_names}} };
static const char *const plant_outputs[PLANT_OUT] = { {{plant_output_names}} };
static const springline_real plant_time_step = {{plant_time_step}};

static bits bits_of(springline_real x) {
  bits b;
  memcpy(&b, &x, sizeof b);
  return b;
}

/* Says where the first difference is and returns 1, or returns 0. */
static int differs(
    const char *what, long line, const char *const *names, int count,
    const springline_real *expected, const springline_real *got) {
  int i, bit;
  for (i = 0; i < count; i++) {
    const bits difference = bits_of(expected[i]) ^ bits_of(got[i]);
    if (difference == 0) continue;
    for (bit = {{bits}} - 1; ((difference >> bit) & 1u) == 0; bit--) continue;
    printf("line %ld: %s of %s is %a, expected %a; first differing bit: %d (0 is the last of the significand)\n", line,
           names[i], what, (double)got[i], (double)expected[i], bit);
    return 1;
  }
  return 0;
}

static void read_control(
    const springline_real *in, springline_reference *reference,
    springline_measurement *measurement) {
{{control_from_vector}}
}

static int replay_control(
    springline_controller *controller, long line, const springline_real *in,
    const springline_real *expected) {
  springline_reference reference;
  springline_measurement measurement;
  springline_command command;
  springline_diagnostics diagnostics;
  springline_real got[CONTROL_OUT];
  int status;
{{memory_check}}  read_control(in, &reference, &measurement);
  status = springline_step(controller, &reference, &measurement, &command, &diagnostics);
  if (status != SPRINGLINE_OK) {
    printf("line %ld: springline_step: %s\n", line, springline_status_text(status));
    return 1;
  }
{{control_to_vector}}
  return differs("springline_step", line, control_outputs, CONTROL_OUT, expected, got);
}

/* A sensor is out: the fallback has to be the first outputs of `expected`, or zero where it is NULL. */
static int replay_fault(
    springline_controller *controller, long line, const springline_real *in,
    const springline_real *expected) {
  static const springline_real zero[COMMAND_OUT] = {{{zero}}};
  springline_reference reference;
  springline_measurement measurement;
  springline_command command;
  springline_real got[COMMAND_OUT];
  read_control(in, &reference, &measurement);
  measurement.{{first_measurement}} = {{NAN}};
  if (springline_step(controller, &reference, &measurement, &command, NULL) != SPRINGLINE_BAD_MEASUREMENT) {
    printf("line %ld: springline_step took a measurement that is not a number\n", line);
    return 1;
  }
{{command_to_vector}}
  return differs("the fallback of springline_step", line, control_outputs, COMMAND_OUT, expected != NULL ? expected : zero, got);
}

/* A controller that runs: what is refused changes nothing, what is taken keeps the last command, a reset forgets it. */
static int replay_retuning(
    springline_controller *controller, long line, const springline_real *in,
    const springline_real *expected) {
  springline_config config = springline_default_config;
{{memory_local}}  if ({{again}}replay_control(controller, line, in, expected)) return 1;
{{memory_seen}}  config.fallback = SPRINGLINE_FALLBACK_LAST;
  if (springline_set_parameters(controller, &config) != SPRINGLINE_OK) {
    printf("self_check: springline_set_parameters refused the default parameters\n");
    return 1;
  }
  config.fallback = SPRINGLINE_FALLBACK_LAST + 1;
  if (springline_set_parameters(controller, &config) != SPRINGLINE_BAD_FALLBACK) {
    printf("self_check: springline_set_parameters took a fallback that there is not\n");
    return 1;
  }
{{bad_parameter}}  if (replay_fault(controller, line, in, expected) || {{kept}}{{again}}replay_control(controller, line, in, expected)) return 1;
  if (springline_reset(controller) != SPRINGLINE_OK) {
    printf("self_check: springline_reset refused a controller that runs\n");
    return 1;
  }
  if (replay_fault(controller, line, in, NULL) || replay_control(controller, line, in, expected)) return 1;
  return springline_set_parameters(controller, &springline_default_config) != SPRINGLINE_OK;
}

/* The same inputs through the function that CasADi printed. */
static int replay_model(long line, const springline_real *in, const springline_real *expected) {
  springline_real got[MODEL_OUT];
{{model_call}}
  return differs("springline_control", line, control_outputs, MODEL_OUT, expected, got);
}

static int replay_plant(
    const springline_controller *controller, long line, const springline_real *in,
    const springline_real *expected) {
  springline_state state;
  springline_command command;
  springline_base base[SPRINGLINE_BASE_NODES];
  springline_real got[PLANT_OUT];
  int status, i;
{{plant_from_vector}}
  for (i = 1; i < SPRINGLINE_BASE_NODES; i++) base[i] = base[0];
  status = springline_plant_step(controller, &state, &command, base, plant_time_step);
  if (status != SPRINGLINE_OK) {
    printf("line %ld: springline_plant_step: %s\n", line, springline_status_text(status));
    return 1;
  }
{{plant_to_vector}}
  return differs("springline_plant_step", line, plant_outputs, PLANT_OUT, expected, got);
}

/* Reads `count` hexadecimal numbers; the rest of the text, or NULL if they are not there. */
static char *read_numbers(char *text, springline_real *numbers, int count) {
  int i;
  for (i = 0; i < count && text != NULL; i++) {
    char *end;
    numbers[i] = {{strto}}(text, &end);
    text = end == text ? NULL : end;
  }
  return text;
}

int main(int argc, char **argv) {
  const char *path = argc > 1 ? argv[1] : "test_vectors.txt";
  static char text[LINE];
  springline_real in[CONTROL_IN > PLANT_IN ? CONTROL_IN : PLANT_IN], out[CONTROL_OUT > PLANT_OUT ? CONTROL_OUT : PLANT_OUT];
  springline_controller controller;
  long line = 0, controls = 0, plants = 0, failures = 0;
  FILE *file = fopen(path, "r");
  if (file == NULL) {
    printf("self_check: cannot read %s; give its path as the argument\n", path);
    return 2;
  }
  if (springline_init(&controller, &springline_default_config) != SPRINGLINE_OK) {
    printf("self_check: the default configuration was refused\n");
    return 1;
  }
  while (fgets(text, LINE, file) != NULL) {
    char *rest = NULL;
    line++;
    if (text[0] == '#') continue;
    if (strncmp(text, "control ", 8) == 0) {
      rest = read_numbers(text + 8, in, CONTROL_IN);
      if (rest != NULL) rest = read_numbers(rest, out, CONTROL_OUT);
      if (rest != NULL) failures += replay_control(&controller, line, in, out) | replay_model(line, in, out);
      if (rest != NULL && controls == 0) failures += replay_retuning(&controller, line, in, out);
      controls++;
    } else if (strncmp(text, "plant ", 6) == 0) {
      rest = read_numbers(text + 6, in, PLANT_IN);
      if (rest != NULL) rest = read_numbers(rest, out, PLANT_OUT);
      if (rest != NULL) failures += replay_plant(&controller, line, in, out);
      plants++;
    }
    if (rest == NULL) {
      printf("%s, line %ld: not a test vector of this export\n", path, line);
      fclose(file);
      return 2;
    }
    if (failures > 0) break;
  }
  fclose(file);
  if (failures > 0) {
    printf("FAILED: compile as C99 with -ffp-contract=off, without -ffast-math, doubles evaluated as double\n");
    return 1;
  }
  printf("%ld control steps and %ld plant steps: all bits as expected\n", controls, plants);
  return controls > 0 && plants > 0 ? 0 : 2;
}
