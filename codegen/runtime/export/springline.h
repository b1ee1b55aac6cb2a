#ifndef SPRINGLINE_H
#define SPRINGLINE_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What made this, and of what: SHA-256 of model, parameters and options. */
#define SPRINGLINE_VERSION "{{version}}"
#define SPRINGLINE_MODEL_HASH "{{model_hash}}"

typedef {{real}} springline_real;

/* What every function returns; springline_status_text says what to do about it. */
enum {
{{status_enum}}
};

/* What springline_step commands when it returns anything but SPRINGLINE_OK. */
enum {
  SPRINGLINE_FALLBACK_ZERO = 0, /* zero force */
  SPRINGLINE_FALLBACK_LAST = 1  /* the last command that was computed without fault, zero before the first */
};

/* Where the arm should be: joint coordinates q1d, their rates dq1d and accelerations ddq1d. */
typedef struct springline_reference {
{{reference_fields}}
} springline_reference;

/* Where the arm is: joint coordinates q1 and rates dq1, motor rates dq2 (reflected to the joint). */
typedef struct springline_measurement {
{{measurement_fields}}
} springline_measurement;

/* What the motors should do. */
typedef struct springline_command {
{{command_fields}}
} springline_command;

/* {{diagnostics_meaning}} */
typedef struct springline_diagnostics {
{{diagnostics_fields}}
} springline_diagnostics;

/* The plant's state: joint coordinates q1, motor coordinates q2 (reflected to the joint), and their rates. */
typedef struct springline_state {
{{state_fields}}
} springline_state;

/* Motion of the base along X forward, Y up and Z to starboard, its rates d_ and accelerations dd_. */
typedef struct springline_base {
{{base_fields}}
} springline_base;

{{parameter_struct}}typedef struct springline_config {
  int32_t fallback; /* SPRINGLINE_FALLBACK_ZERO or SPRINGLINE_FALLBACK_LAST */
{{config_parameters}}} springline_config;

/* {{default_config_meaning}} */
extern const springline_config springline_default_config;

{{memory_struct}}/* A controller and all it needs. The caller owns it; only the functions below touch its fields. {{controller_bytes}} bytes. */
typedef struct springline_controller {
  springline_config config;
{{controller_derived}}{{controller_memory}}  springline_command last;
  int32_t ready;
} springline_controller;

/*
 * Prepares a controller, at start-up: whatever the memory held before is forgotten. If it fails the controller is not
 * ready and commands zero force; a controller that runs already is retuned by springline_set_parameters instead.
 */
int springline_init(springline_controller *controller, const springline_config *config);

/*
 * Retunes a running controller between two steps: all of *config is checked, then taken. {{what_may_change}}
 * {{kept}} If it fails nothing has changed, and the controller goes on as it was.
 */
int springline_set_parameters(springline_controller *controller, const springline_config *config);

/* {{forgetting}} */
int springline_reset(springline_controller *controller);

/*
 * {{step_meaning}}
 */
int springline_step(
    springline_controller *controller, const springline_reference *reference,
    const springline_measurement *measurement, springline_command *command,
    springline_diagnostics *diagnostics);

/* When a plant step needs the base's motion, in parts of the step: 0 is its start, 1 its end. */
#define SPRINGLINE_BASE_NODES {{base_nodes}}
extern const springline_real springline_base_nodes[{{base_nodes}}];

/*
 * The plant, for tests and hardware in the loop: state after `step` seconds ({{integrator}}, one step; take 1e-4) under a
 * constant command. base[i] is the base's motion at springline_base_nodes[i]; base = NULL for a base at rest. If it fails
 * *state is left as it was.
 */
int springline_plant_step(
    const springline_controller *controller, springline_state *state,
    const springline_command *command, const springline_base *base, springline_real step);

/* What the sensors show of the plant's state, one sample of it. */
int springline_measure(
    const springline_controller *controller, springline_state *state,
    springline_measurement *measurement);

/* The plant's initial state. */
int springline_start(const springline_controller *controller, springline_state *state);

/* {{signals_meaning}} */
int springline_signals(
    const springline_controller *controller, springline_real t, springline_reference *reference,
    springline_base *base);

/* What a status means and what to do about it, one English sentence; never NULL. */
const char *springline_status_text(int status);

#ifdef __cplusplus
}
#endif
#endif /* SPRINGLINE_H */
