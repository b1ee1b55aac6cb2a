#include "springline.h"

#include <stddef.h>

#include "{{math_header}}"
{{tables}}
enum { SPRINGLINE_READY = 0x5a17 }; /* springline_init has been here */

const springline_config springline_default_config = {{default_config}};

const springline_real springline_base_nodes[SPRINGLINE_BASE_NODES] = {{base_node_values}};

static const springline_command springline_no_command = {{zero_command}};
static const springline_diagnostics springline_no_diagnostics = {{zero_diagnostics}};
static const springline_base springline_base_at_rest = {{zero_base}};
{{initial_memory}}
/* A compile-time error where a controller takes more than the {{controller_bytes}} bytes that springline.h says. */
typedef char springline_controller_has_its_size[sizeof(springline_controller) <= {{controller_bytes}}u ? 1 : -1];

static int springline_is_finite(springline_real x) { return {{math}}_isfinite(x); }

/* ---- the model, printed from the frozen expressions ------------------------------------------------------- */

{{derive}}/* Whether the acceleration that the law asks for is finite, before a_max; {{control_operations}} operations */
static int springline_evaluate_control(
    const springline_controller *controller, const springline_reference *reference,
    const springline_measurement *measurement, springline_command *command,
    springline_diagnostics *diagnostics{{ahead_parameter}}) {
{{control}}
}

/* dx/dt; {{plant_operations}} operations */
static void springline_evaluate_plant(
    const springline_controller *controller, const springline_base *base, const springline_real *x,
    const springline_command *command, springline_real *dx) {
{{plant}}
}

/* ---- checks ------------------------------------------------------------------------------------------------ */

static int springline_reference_is_finite(const springline_reference *reference) {
  return {{reference_is_finite}};
}

static int springline_measurement_is_finite(const springline_measurement *measurement) {
  return {{measurement_is_finite}};
}

static int springline_command_is_finite(const springline_command *command) {
  return {{command_is_finite}};
}

static int springline_base_is_finite(const springline_base *base) {
  return {{base_is_finite}};
}

/* Looks at what stands before the limits, for a limit turns NaN and infinity into a number. */
static int springline_control_is_finite(const springline_diagnostics *diagnostics{{ahead_checked}}) {
  return {{control_is_finite}};
}

static int springline_state_is_finite(const springline_real *x) {
  int i;
  for (i = 0; i < {{states}}; i++) {
    if (!springline_is_finite(x[i])) return 0;
  }
  return 1;
}

{{parameters_check}}static int springline_is_ready(const springline_controller *controller) {
  return controller->ready == SPRINGLINE_READY;
}

/* What is wrong with a configuration, before anything of it is taken. */
static int springline_judge(const springline_config *config) {
  if (config == NULL) return SPRINGLINE_NULL_ARGUMENT;
  if (config->fallback != SPRINGLINE_FALLBACK_ZERO && config->fallback != SPRINGLINE_FALLBACK_LAST) {
    return SPRINGLINE_BAD_FALLBACK;
  }
{{judge_parameters}}  return SPRINGLINE_OK;
}

static void springline_take(springline_controller *controller, const springline_config *config) {
  controller->config = *config;
{{take_derived}}}

/* ---- the interface ----------------------------------------------------------------------------------------- */

int springline_init(springline_controller *controller, const springline_config *config) {
  int status;
  if (controller == NULL) return SPRINGLINE_NULL_ARGUMENT;
  controller->ready = 0; /* what was there before may be anything, so a refusal leaves nothing of it */
  controller->last = springline_no_command;
{{forget}}  status = springline_judge(config);
  if (status != SPRINGLINE_OK) return status;
  springline_take(controller, config);
  controller->ready = SPRINGLINE_READY;
  return SPRINGLINE_OK;
}

int springline_set_parameters(springline_controller *controller, const springline_config *config) {
  int status;
  if (controller == NULL) return SPRINGLINE_NULL_ARGUMENT;
  if (!springline_is_ready(controller)) return SPRINGLINE_NOT_INITIALIZED;
  status = springline_judge(config);
  if (status == SPRINGLINE_OK) springline_take(controller, config);
  return status;
}

int springline_reset(springline_controller *controller) {
  if (controller == NULL) return SPRINGLINE_NULL_ARGUMENT;
  if (!springline_is_ready(controller)) return SPRINGLINE_NOT_INITIALIZED;
  controller->last = springline_no_command;
{{forget}}  return SPRINGLINE_OK;
}

int springline_step(
    springline_controller *controller, const springline_reference *reference,
    const springline_measurement *measurement, springline_command *command,
    springline_diagnostics *diagnostics) {
  springline_command wished = springline_no_command;
  springline_diagnostics seen = springline_no_diagnostics;
{{ahead_local}}  int status = SPRINGLINE_OK;
  if (controller == NULL || reference == NULL || measurement == NULL || command == NULL) {
    status = SPRINGLINE_NULL_ARGUMENT;
  } else if (!springline_is_ready(controller)) {
    status = SPRINGLINE_NOT_INITIALIZED;
  } else if (!springline_reference_is_finite(reference)) {
    status = SPRINGLINE_BAD_REFERENCE;
  } else if (!springline_measurement_is_finite(measurement)) {
    status = SPRINGLINE_BAD_MEASUREMENT;
  } else {
    const int finite =
        springline_evaluate_control(controller, reference, measurement, &wished, &seen{{ahead_argument}});
    if (!finite || !springline_control_is_finite(&seen{{ahead_argument}})) status = SPRINGLINE_OVERFLOW;
  }
  if (status == SPRINGLINE_OK) {
    controller->last = wished;
{{keep_ahead}}  } else {
    const int ready = controller != NULL && springline_is_ready(controller);
    wished = ready && controller->config.fallback == SPRINGLINE_FALLBACK_LAST ? controller->last : springline_no_command;
    seen = springline_no_diagnostics;
  }
  if (command != NULL) *command = wished;
  if (diagnostics != NULL) *diagnostics = seen;
  return status;
}

int springline_plant_step(
    const springline_controller *controller, springline_state *state,
    const springline_command *command, const springline_base *base, springline_real step) {
  const springline_base *motion[SPRINGLINE_BASE_NODES];
  springline_real x[{{states}}], at[{{states}}], next[{{states}}]{{slopes}};
  int i;
  if (controller == NULL || state == NULL || command == NULL) return SPRINGLINE_NULL_ARGUMENT;
  if (!springline_is_ready(controller)) return SPRINGLINE_NOT_INITIALIZED;
  if (!springline_is_finite(step) || step <= 0.0{{f}}) return SPRINGLINE_BAD_PLANT_INPUT;
  if (!springline_command_is_finite(command)) return SPRINGLINE_BAD_PLANT_INPUT;
  for (i = 0; i < SPRINGLINE_BASE_NODES; i++) {
    motion[i] = base != NULL ? &base[i] : &springline_base_at_rest;
    if (!springline_base_is_finite(motion[i])) return SPRINGLINE_BAD_PLANT_INPUT;
  }
{{state_to_x}}
  if (!springline_state_is_finite(x)) return SPRINGLINE_BAD_PLANT_INPUT;
{{plant_stages}}
  if (!springline_state_is_finite(next)) return SPRINGLINE_DIVERGED;
{{next_to_state}}
  return SPRINGLINE_OK;
}

int springline_measure(
    const springline_controller *controller, springline_state *state,
    springline_measurement *measurement) {
  if (controller == NULL || state == NULL || measurement == NULL) return SPRINGLINE_NULL_ARGUMENT;
  if (!springline_is_ready(controller)) return SPRINGLINE_NOT_INITIALIZED;
{{measure}}
  return SPRINGLINE_OK;
}

int springline_start(const springline_controller *controller, springline_state *state) {
  if (controller == NULL || state == NULL) return SPRINGLINE_NULL_ARGUMENT;
  if (!springline_is_ready(controller)) return SPRINGLINE_NOT_INITIALIZED;
{{start}}
  return SPRINGLINE_OK;
}

int springline_signals(
    const springline_controller *controller, springline_real t, springline_reference *reference,
    springline_base *base) {
  if (controller == NULL || reference == NULL || base == NULL) return SPRINGLINE_NULL_ARGUMENT;
  if (!springline_is_ready(controller)) return SPRINGLINE_NOT_INITIALIZED;
  if (!springline_is_finite(t)) return SPRINGLINE_BAD_TIME;
  {
{{signals}}
  }
  return SPRINGLINE_OK;
}

const char *springline_status_text(int status) {
  switch (status) {
{{status_cases}}
    default: return "no status of this library";
  }
}
