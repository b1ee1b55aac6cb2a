/*
 * instance.h - an FMU instance, whatever the version of FMI: its values, its time, its modes and what they allow.
 *
 * Included once, by fmi2.c or fmi3.c, which define fmu_logger and fmu_log; fmu_model.h says what variables there are.
 * One of controller.c, plant.c and loop.c says what they do: fmu_begin, fmu_evaluate, fmu_advance.
 * A value reference is an index into `values`. The state of an instance is one structure without pointers, which is
 * what is saved, restored and serialised.
 */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FMU_OK = 0, FMU_ERROR = 1, FMU_MESSAGE = 512 };

enum {
  FMU_INSTANTIATED = 1,
  FMU_INITIALIZING = 2,
  FMU_STEPPING = 4,
  FMU_TERMINATED = 8,
  FMU_FAILED = 16,
  FMU_SETTABLE = FMU_INSTANTIATED | FMU_INITIALIZING | FMU_STEPPING,
  FMU_ANY = 31
};

/* What an instance may be asked to restore: doubles first, then integers, so that no byte of it is padding. */
typedef struct {
  double values[FMU_VALUES];
  double start, time, stop;
  int64_t step;    /* grid points of step or sample period passed since `start` */
  int32_t between; /* 1: time is between two grid points */
  int32_t has_stop;
  int32_t mode;
  int32_t reserved;
} fmu_state;

typedef struct {
  fmu_state now;
  springline_controller controller;
  int configured; /* controller holds the parameters of `now` */
  int fresh;      /* outputs of `now` belong to its inputs and time */
  fmu_logger logger;
  void *environment;
  char name[]; /* of the instance */
} fmu_instance;

static void fmu_log(const fmu_instance *fmu, const char *message);

/* What a part does; each returns a status of springline.h. */
static int fmu_begin(fmu_instance *fmu);                  /* sets the initial state */
static int fmu_evaluate(fmu_instance *fmu);               /* sets the outputs of this time */
static int fmu_advance(fmu_instance *fmu, double until);  /* goes on to a later time */

/* ---- messages ---------------------------------------------------------------------------------------------- */

static int fmu_refuse(const fmu_instance *fmu, const char *format, ...) {
  char message[FMU_MESSAGE];
  va_list arguments;
  va_start(arguments, format);
  (void)vsnprintf(message, sizeof message, format, arguments);
  va_end(arguments);
  fmu_log(fmu, message);
  return FMU_ERROR;
}

/* Nothing more can be computed until the instance is reset or restored. */
static int fmu_fail(fmu_instance *fmu, const char *function, int status) {
  fmu->now.mode = FMU_FAILED;
  return fmu_refuse(fmu, "%s: at %.17g s: %s", function, fmu->now.time, springline_status_text(status));
}

static int fmu_allowed(const fmu_instance *fmu, const char *function, int modes) {
  const char *mode;
  if (fmu == NULL) return 0;
  if ((fmu->now.mode & modes) != 0) return 1;
  switch (fmu->now.mode) {
    case FMU_INSTANTIATED: mode = "before initialization"; break;
    case FMU_INITIALIZING: mode = "in initialization mode"; break;
    case FMU_STEPPING: mode = "after initialization"; break;
    case FMU_TERMINATED: mode = "after termination"; break;
    default: mode = "after an error: reset the instance or restore a state"; break;
  }
  (void)fmu_refuse(fmu, "%s may not be called %s", function, mode);
  return 0;
}

static int fmu_unsupported(const fmu_instance *fmu, const char *function) {
  return fmu == NULL ? FMU_ERROR : fmu_refuse(fmu, "%s: this FMU does not offer it (modelDescription.xml)", function);
}

/* Whether a pointer that may not be NULL is one; instance pointers are checked by fmu_allowed. */
static int fmu_given(const fmu_instance *fmu, const char *function, const void *pointer, size_t count) {
  if (pointer != NULL || count == 0) return 1;
  (void)fmu_refuse(fmu, "%s: a pointer is NULL that may not be", function);
  return 0;
}

/* ---- time -------------------------------------------------------------------------------------------------- */

/* Time of half grid step j, as in the simulation loop: never accumulated. */
static double fmu_grid_time(const fmu_state *now, int64_t j) { return now->start + (0.5 * (double)j) * FMU_GRID; }

/* How far a time may be off and still be meant: importers add steps up, we do not. */
static double fmu_tolerance(double t) {
  const double grid = 1e-3 * FMU_GRID, digits = 1e-12 * sl_fabs(t);
  return FMU_GRID > 0.0 ? sl_fmax(grid, digits) : sl_fmax(1e-9, digits);
}

/* ---- life -------------------------------------------------------------------------------------------------- */

static void fmu_reset(fmu_instance *fmu) {
  int i;
  memset(&fmu->now, 0, sizeof fmu->now);
  for (i = 0; i < FMU_VALUES; i++) fmu->now.values[i] = fmu_variables[i].start;
  fmu->now.mode = FMU_INSTANTIATED;
  fmu->configured = fmu->fresh = 0;
}

static fmu_instance *fmu_new(const char *name, const char *token, fmu_logger logger, void *environment) {
  const size_t length = name != NULL ? strlen(name) : 0;
  fmu_instance *fmu = calloc(1, sizeof *fmu + length + 1);
  if (fmu == NULL) return NULL;
  if (length > 0) memcpy(fmu->name, name, length);
  fmu->logger = logger;
  fmu->environment = environment;
  if (length == 0) {
    (void)fmu_refuse(fmu, "the instance has no name");
  } else if (token == NULL || strcmp(token, FMU_TOKEN) != 0) {
    (void)fmu_refuse(fmu, "the token is %s, expected %s: binary and modelDescription.xml are of different FMUs",
                     token != NULL ? token : "NULL", FMU_TOKEN);
  } else {
    fmu_reset(fmu);
    return fmu;
  }
  free(fmu);
  return NULL;
}

static int fmu_configure(fmu_instance *fmu) {
  springline_config config = springline_default_config;
  int status;
  if (fmu->configured) return SPRINGLINE_OK;
  fmu_get_parameters(fmu->now.values + FMU_AT_PARAMETERS, &config);
  status = springline_init(&fmu->controller, &config);
  fmu->configured = status == SPRINGLINE_OK;
  return status;
}

static int fmu_refresh(fmu_instance *fmu, const char *function) {
  int status;
  if (fmu->fresh || (fmu->now.mode & (FMU_INITIALIZING | FMU_STEPPING)) == 0) return FMU_OK;
  status = fmu_configure(fmu);
  if (status == SPRINGLINE_OK && fmu->now.mode == FMU_INITIALIZING) status = fmu_begin(fmu);
  if (status == SPRINGLINE_OK) status = fmu_evaluate(fmu);
  if (status != SPRINGLINE_OK) return fmu_fail(fmu, function, status);
  fmu->fresh = 1;
  return FMU_OK;
}

static int fmu_set_experiment(fmu_instance *fmu, const char *function, double start, int has_stop, double stop) {
  if (!sl_isfinite(start) || (has_stop && !(sl_isfinite(stop) && stop >= start))) {
    return fmu_refuse(fmu, "%s: start time %g s and stop time %g s are no interval", function, start, stop);
  }
  if (start < FMU_SINCE - fmu_tolerance(start)) {
    return fmu_refuse(fmu, "%s: start time %g s, but the scenario's tables begin at %g s", function, start, FMU_SINCE);
  }
  fmu->now.start = fmu->now.time = fmu->now.values[0] = start;
  fmu->now.stop = has_stop ? stop : 0.0;
  fmu->now.has_stop = has_stop;
  return FMU_OK;
}

static int fmu_exit_initialization(fmu_instance *fmu, const char *function) {
  const int result = fmu_refresh(fmu, function);
  if (result == FMU_OK) fmu->now.mode = FMU_STEPPING;
  return result;
}

/* ---- values ------------------------------------------------------------------------------------------------ */

static int fmu_known(const fmu_instance *fmu, const char *function, unsigned reference, int boolean) {
  if (reference >= FMU_VALUES) {
    (void)fmu_refuse(fmu, "%s: there is no value reference %u", function, reference);
    return 0;
  }
  if (fmu_variables[reference].boolean != boolean) {
    (void)fmu_refuse(fmu, "%s: %s is of another type", function, fmu_variables[reference].name);
    return 0;
  }
  return 1;
}

static int fmu_get(fmu_instance *fmu, const char *function, unsigned reference, int boolean, double *value) {
  if (!fmu_known(fmu, function, reference, boolean)) return FMU_ERROR;
  if (fmu_variables[reference].causality == FMU_OUTPUT && fmu_refresh(fmu, function) != FMU_OK) return FMU_ERROR;
  *value = fmu->now.values[reference];
  return FMU_OK;
}

static int fmu_admissible(const fmu_variable *variable, double value) {
  if (!sl_isfinite(value)) return variable->infinite && value == SL_INF;
  if (value < variable->low || (variable->low_open && value == variable->low)) return 0;
  if (value > variable->high || (variable->high_open && value == variable->high)) return 0;
  return !variable->even || sl_floor(0.5 * value) == 0.5 * value;
}

/* A value that may not be set is refused and changes nothing. */
static int fmu_set(fmu_instance *fmu, const char *function, unsigned reference, double value) {
  const fmu_variable *variable;
  if (!fmu_known(fmu, function, reference, 0)) return FMU_ERROR;
  variable = &fmu_variables[reference];
  if (variable->causality != FMU_PARAMETER && variable->causality != FMU_INPUT) {
    return fmu_refuse(fmu, "%s: %s is neither a parameter nor an input", function, variable->name);
  }
  if (variable->fixed && fmu->now.mode == FMU_STEPPING) {
    return fmu_refuse(fmu, "%s: %s is fixed after initialization", function, variable->name);
  }
  if (!fmu_admissible(variable, value)) {
    return fmu_refuse(fmu, "%s: %s is %g, expected %s", function, variable->name, value, variable->expected);
  }
  fmu->now.values[reference] = value;
  fmu->fresh = 0;
  if (variable->causality == FMU_PARAMETER) fmu->configured = 0;
  return FMU_OK;
}

/* ---- steps ------------------------------------------------------------------------------------------------- */

static int fmu_do_step(fmu_instance *fmu, const char *function, double from, double length) {
  fmu_state *now = &fmu->now;
  const double until = from + length;
  int status;
  if (!sl_isfinite(from) || !sl_isfinite(until) || !(length > 0.0)) {
    return fmu_refuse(fmu, "%s: a step of %g s from %g s is impossible", function, length, from);
  }
  if (sl_fabs(from - now->time) > fmu_tolerance(from)) {
    return fmu_refuse(fmu, "%s: a step from %.17g s, but the instance is at %.17g s", function, from, now->time);
  }
  if (now->has_stop && until > now->stop + fmu_tolerance(until)) {
    return fmu_refuse(fmu, "%s: a step to %.17g s, but the experiment stops at %.17g s", function, until, now->stop);
  }
  if (until > FMU_UNTIL + fmu_tolerance(until)) {
    return fmu_refuse(fmu, "%s: a step to %.17g s, but the scenario's tables end at %.17g s", function, until,
                      FMU_UNTIL);
  }
  if (FMU_GRID > 0.0 && length / FMU_GRID > 1e9) {
    return fmu_refuse(fmu, "%s: a step of %g s is more than 1e9 steps of %g s", function, length, FMU_GRID);
  }
  status = fmu_configure(fmu);
  if (status == SPRINGLINE_OK) status = fmu_advance(fmu, until);
  fmu->fresh = 0;
  now->values[0] = now->time;
  return status == SPRINGLINE_OK ? FMU_OK : fmu_fail(fmu, function, status);
}

/* ---- saved states ------------------------------------------------------------------------------------------ */

typedef struct {
  char token[48];
  uint64_t checksum;
  fmu_state state;
} fmu_serialized;

static uint64_t fmu_checksum(const fmu_state *state) { /* FNV-1a */
  const unsigned char *bytes = (const unsigned char *)state;
  uint64_t hash = UINT64_C(14695981039346656037);
  size_t i;
  for (i = 0; i < sizeof *state; i++) hash = (hash ^ bytes[i]) * UINT64_C(1099511628211);
  return hash;
}

/* Into *saved, allocated if it is NULL. */
static int fmu_save(fmu_instance *fmu, const char *function, void **saved) {
  fmu_state *copy;
  if (fmu_refresh(fmu, function) != FMU_OK) return FMU_ERROR;
  copy = *saved != NULL ? *saved : malloc(sizeof *copy);
  if (copy == NULL) return fmu_refuse(fmu, "%s: no memory", function);
  *copy = fmu->now;
  *saved = copy;
  return FMU_OK;
}

static void fmu_restore(fmu_instance *fmu, const void *saved) {
  memcpy(&fmu->now, saved, sizeof fmu->now);
  fmu->configured = fmu->fresh = 0;
}

static int fmu_serialize(const fmu_instance *fmu, const char *function, const void *saved, void *bytes, size_t size) {
  fmu_serialized form;
  if (size < sizeof form) {
    return fmu_refuse(fmu, "%s: %lu bytes do not hold a state of %lu", function, (unsigned long)size,
                      (unsigned long)sizeof form);
  }
  memset(&form, 0, sizeof form);
  memcpy(form.token, FMU_TOKEN, sizeof FMU_TOKEN);
  memcpy(&form.state, saved, sizeof form.state);
  form.checksum = fmu_checksum(&form.state);
  memcpy(bytes, &form, sizeof form);
  return FMU_OK;
}

static int fmu_deserialize(const fmu_instance *fmu, const char *function, const void *bytes, size_t size,
                           void **saved) {
  fmu_serialized form;
  fmu_state *copy;
  if (size < sizeof form) return fmu_refuse(fmu, "%s: these bytes are too few for a state", function);
  memcpy(&form, bytes, sizeof form);
  if (memcmp(form.token, FMU_TOKEN, sizeof FMU_TOKEN) != 0 || form.checksum != fmu_checksum(&form.state)) {
    return fmu_refuse(fmu, "%s: these bytes are no state of this FMU", function);
  }
  copy = malloc(sizeof *copy);
  if (copy == NULL) return fmu_refuse(fmu, "%s: no memory", function);
  *copy = form.state;
  *saved = copy;
  return FMU_OK;
}
