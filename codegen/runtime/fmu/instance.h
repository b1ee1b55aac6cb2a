/*
 * instance.h - an FMU instance, whatever the version of FMI: its modes and what they allow, its values, steps and states.
 *
 * Included once, by fmi2.c or fmi3.c, which define fmu_logger and fmu_log; state.h and the part come before it.
 */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

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

typedef struct {
  fmu_core core;
  int fresh; /* outputs belong to the inputs and the time that they stand beside */
  fmu_logger logger;
  void *environment;
  char name[]; /* of the instance */
} fmu_instance;

static void fmu_log(const fmu_instance *fmu, const char *message);

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
  fmu->core.now.mode = FMU_FAILED;
  return fmu_refuse(fmu, "%s: at %.17g s: %s", function, fmu->core.now.clock, springline_status_text(status));
}

static int fmu_allowed(const fmu_instance *fmu, const char *function, int modes) {
  const char *mode;
  if (fmu == NULL) return 0;
  if ((fmu->core.now.mode & modes) != 0) return 1;
  switch (fmu->core.now.mode) {
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

/* ---- life -------------------------------------------------------------------------------------------------- */

static springline_config fmu_config(const double *values) {
  springline_config config = springline_default_config;
  fmu_get_parameters(values + FMU_AT_PARAMETERS, &config);
  return config;
}

/* Takes a state whole, with a controller of its own, or leaves everything as it was. */
static int fmu_take(fmu_instance *fmu, const char *function, const fmu_state *state) {
  const springline_config config = fmu_config(state->values);
  fmu_core core;
  int status;
  core.now = *state;
  status = springline_init(&core.controller, &config);
  if (status != SPRINGLINE_OK) return fmu_refuse(fmu, "%s: %s", function, springline_status_text(status));
  fmu->core = core;
  fmu->fresh = 0;
  return FMU_OK;
}

static int fmu_reset(fmu_instance *fmu, const char *function) {
  fmu_state state;
  int i;
  memset(&state, 0, sizeof state);
  for (i = 0; i < FMU_VALUES; i++) state.values[i] = fmu_variables[i].start;
  state.mode = FMU_INSTANTIATED;
  return fmu_take(fmu, function, &state);
}

static fmu_instance *fmu_new(const char *function, const char *name, const char *token, fmu_logger logger,
                             void *environment) {
  const size_t length = name != NULL ? strlen(name) : 0;
  fmu_instance *fmu = calloc(1, sizeof *fmu + length + 1);
  if (fmu == NULL) return NULL;
  if (length > 0) memcpy(fmu->name, name, length);
  fmu->logger = logger;
  fmu->environment = environment;
  if (length == 0) {
    (void)fmu_refuse(fmu, "%s: the instance has no name", function);
  } else if (token == NULL || strcmp(token, FMU_TOKEN) != 0) {
    (void)fmu_refuse(fmu, "%s: the token is %s, expected %s: binary and modelDescription.xml are of different FMUs",
                     function, token != NULL ? token : "NULL", FMU_TOKEN);
  } else if (fmu_reset(fmu, function) == FMU_OK) {
    return fmu;
  }
  free(fmu);
  return NULL;
}

static int fmu_refresh(fmu_instance *fmu, const char *function) {
  const int64_t mode = fmu->core.now.mode;
  int status = SPRINGLINE_OK;
  if (fmu->fresh || (mode & (FMU_INITIALIZING | FMU_STEPPING)) == 0) return FMU_OK;
  if (mode == FMU_INITIALIZING) status = fmu_begin(&fmu->core);
  if (status == SPRINGLINE_OK) status = fmu_evaluate(&fmu->core);
  if (status != SPRINGLINE_OK) return fmu_fail(fmu, function, status);
  fmu->fresh = 1;
  return FMU_OK;
}

static int fmu_set_experiment(fmu_instance *fmu, const char *function, double start, int has_stop, double stop) {
  fmu_state *now = &fmu->core.now;
  if (!sl_isfinite(start) || (has_stop && !(sl_isfinite(stop) && stop >= start))) {
    return fmu_refuse(fmu, "%s: start time %g s and stop time %g s are no interval", function, start, stop);
  }
  if (!fmu_resolves(start)) {
    return fmu_refuse(fmu, "%s: at the start time %.17g s numbers are %g s apart, more than a hundredth of a step of "
                      "%g s: start nearer to 0", function, start, fmu_spacing(start), FMU_GRID);
  }
  now->start = now->clock = now->values[0] = start;
  now->stop = has_stop ? stop : 0.0;
  now->has_stop = has_stop ? 1 : 0;
  return FMU_OK;
}

static int fmu_exit_initialization(fmu_instance *fmu, const char *function) {
  const int result = fmu_refresh(fmu, function);
  if (result == FMU_OK) fmu->core.now.mode = FMU_STEPPING;
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
  if (fmu_variables[reference].causality >= FMU_OUTPUT && fmu_refresh(fmu, function) != FMU_OK) return FMU_ERROR;
  *value = fmu->core.now.values[reference];
  return FMU_OK;
}

static int fmu_admissible(const fmu_variable *variable, double value) {
  if (!sl_isfinite(value)) return variable->infinite && value == SL_INF;
  if (value < variable->low || (variable->low_open && value == variable->low)) return 0;
  if (value > variable->high || (variable->high_open && value == variable->high)) return 0;
  return !variable->even || sl_floor(0.5 * value) == 0.5 * value;
}

/* Whether a variable may be set, now and to this value. */
static int fmu_settable(const fmu_instance *fmu, const char *function, unsigned reference, double value) {
  const fmu_variable *variable;
  if (!fmu_known(fmu, function, reference, 0)) return 0;
  variable = &fmu_variables[reference];
  if (variable->causality != FMU_PARAMETER && variable->causality != FMU_INPUT) {
    (void)fmu_refuse(fmu, "%s: %s is neither a parameter nor an input", function, variable->name);
    return 0;
  }
  if (variable->fixed && fmu->core.now.mode == FMU_STEPPING) {
    (void)fmu_refuse(fmu, "%s: %s is fixed after initialization", function, variable->name);
    return 0;
  }
  if (!fmu_admissible(variable, value)) {
    (void)fmu_refuse(fmu, "%s: %s is %g, expected %s", function, variable->name, value, variable->expected);
    return 0;
  }
  return 1;
}

/* Sets all of the variables, or refuses one of them and sets none. */
static int fmu_set(fmu_instance *fmu, const char *function, const unsigned references[], size_t n,
                   const double values[]) {
  double next[FMU_VALUES];
  int parameters = 0;
  size_t i;
  memcpy(next, fmu->core.now.values, sizeof next);
  for (i = 0; i < n; i++) {
    if (!fmu_settable(fmu, function, references[i], values[i])) return FMU_ERROR;
    next[references[i]] = fmu_variables[references[i]].infinite ? sl_fmin(values[i], FMU_NO_LIMIT) : values[i];
    parameters |= fmu_variables[references[i]].causality == FMU_PARAMETER;
  }
  if (parameters) {
    const springline_config config = fmu_config(next);
    const int status = springline_set_parameters(&fmu->core.controller, &config);
    if (status != SPRINGLINE_OK) return fmu_refuse(fmu, "%s: %s", function, springline_status_text(status));
  }
  memcpy(fmu->core.now.values, next, sizeof next);
  fmu->fresh = 0;
  return FMU_OK;
}

/* ---- steps ------------------------------------------------------------------------------------------------- */

enum { FMU_MOST_STEPS = 1000000000 }; /* in one communication step: minutes to hours of computing */

static int fmu_do_step(fmu_instance *fmu, const char *function, double from, double length) {
  fmu_state *now = &fmu->core.now;
  const double until = from + length, unit = fmu_unit(length);
  fmu_place place;
  int status;
  if (!sl_isfinite(from) || !sl_isfinite(until) || !(until > from)) {
    return fmu_refuse(fmu, "%s: a step of %g s from %.17g s is impossible", function, length, from);
  }
  if (now->has_stop && until > now->stop + fmu_drift(now, now->stop, unit)) {
    return fmu_refuse(fmu, "%s: a step to %.17g s, but the experiment stops at %.17g s", function, until, now->stop);
  }
  if (!fmu_resolves(until)) {
    return fmu_refuse(fmu, "%s: at %.17g s numbers are %g s apart, more than a hundredth of a step of %g s",
                      function, until, fmu_spacing(until), FMU_GRID);
  }
  if (sl_fabs(from - now->clock) > fmu_tolerance(from, unit)) {
    return fmu_refuse(fmu, "%s: a step from %.17g s, but the instance is at %.17g s", function, from, now->clock);
  }
  place = fmu_destination(now, length, until);
  if (place.step - now->step > FMU_MOST_STEPS) {
    return fmu_refuse(fmu, "%s: a step of %g s is more than %d steps of %g s", function, length, (int)FMU_MOST_STEPS,
                      FMU_GRID);
  }
  if (place.time > FMU_UNTIL + fmu_tolerance(until, unit)) {
    return fmu_refuse(fmu, "%s: a step to %.17g s after the start, but the scenario's tables end at %.17g s", function,
                      place.time, FMU_UNTIL);
  }
  status = fmu_advance(&fmu->core, &place);
  fmu->fresh = 0;
  now->calls++;
  now->clock = now->values[0] = status == SPRINGLINE_OK ? until : now->start + now->time;
  return status == SPRINGLINE_OK ? FMU_OK : fmu_fail(fmu, function, status);
}

/* ---- saved states ------------------------------------------------------------------------------------------ */

/* A state outside of its instance, kept by the importer or turned into bytes. */
typedef struct {
  char token[48];
  uint64_t checksum;
  fmu_state state;
} fmu_saved;

static uint64_t fmu_checksum(const fmu_state *state) { /* FNV-1a */
  const unsigned char *bytes = (const unsigned char *)state;
  uint64_t hash = UINT64_C(14695981039346656037);
  size_t i;
  for (i = 0; i < sizeof *state; i++) hash = (hash ^ bytes[i]) * UINT64_C(1099511628211);
  return hash;
}

/* The first thing in a state that no instance can have come to; NULL if there is none. */
static const char *fmu_impossible(const fmu_state *state) {
  const double unit = fmu_unit(state->time);
  const int64_t most = INT64_C(1) << 53;
  int i;
  switch (state->mode) {
    case FMU_INSTANTIATED: case FMU_INITIALIZING: case FMU_STEPPING: case FMU_TERMINATED: case FMU_FAILED: break;
    default: return "its mode";
  }
  if (!sl_isfinite(state->start) || !fmu_resolves(state->start)) return "its start time";
  if (state->has_stop != 0 && state->has_stop != 1) return "its mark of a stop time";
  if (state->has_stop && !(sl_isfinite(state->stop) && state->stop >= state->start)) return "its stop time";
  if (!sl_isfinite(state->time) || state->time < 0.0) return "its time";
  if (state->calls < 0 || state->calls > most) return "its count of communication steps";
  if (state->step < 0 || state->step > most) return "its count of steps";
  if (state->between != 0 && state->between != 1) return "its mark of a time between steps";
  if (FMU_GRID > 0.0) {
    const double last = fmu_grid_time(state->step, 0.0), next = fmu_grid_time(state->step + 1, 0.0);
    if (state->between ? !(last < state->time && state->time < next) : state->time != last) return "its place in a step";
  } else if (state->step != 0 || state->between != 0) {
    return "its place in a step";
  }
  if (state->mode <= FMU_INITIALIZING && (state->time != 0.0 || state->calls != 0)) return "a time before the start";
  if (!sl_isfinite(state->clock) || sl_fabs(state->clock - state->start - state->time) >
                                        fmu_drift(state, state->clock, unit) + fmu_tolerance(state->clock, unit)) {
    return "its communication point";
  }
  if (state->values[0] != state->clock) return fmu_variables[0].name;
  for (i = 1; i < FMU_VALUES; i++) {
    if (!fmu_admissible(&fmu_variables[i], state->values[i])) return fmu_variables[i].name;
    if (fmu_variables[i].boolean && state->values[i] != 0.0 && state->values[i] != 1.0) return fmu_variables[i].name;
  }
  return NULL;
}

static int fmu_possible(const fmu_instance *fmu, const char *function, const fmu_saved *saved) {
  const char *field;
  if (memcmp(saved->token, FMU_TOKEN, sizeof FMU_TOKEN) != 0 || saved->checksum != fmu_checksum(&saved->state)) {
    (void)fmu_refuse(fmu, "%s: this is no state of this FMU", function);
    return 0;
  }
  field = fmu_impossible(&saved->state);
  if (field == NULL) return 1;
  (void)fmu_refuse(fmu, "%s: this is no state that can be: %s is wrong", function, field);
  return 0;
}

/* Into *state, allocated if it is NULL. */
static int fmu_save(fmu_instance *fmu, const char *function, void **state) {
  fmu_saved *saved;
  if (fmu_refresh(fmu, function) != FMU_OK) return FMU_ERROR;
  saved = *state != NULL ? *state : malloc(sizeof *saved);
  if (saved == NULL) return fmu_refuse(fmu, "%s: no memory", function);
  memset(saved, 0, sizeof *saved);
  memcpy(saved->token, FMU_TOKEN, sizeof FMU_TOKEN);
  saved->state = fmu->core.now;
  saved->checksum = fmu_checksum(&saved->state);
  *state = saved;
  return FMU_OK;
}

static int fmu_restore(fmu_instance *fmu, const char *function, const fmu_saved *saved) {
  return fmu_possible(fmu, function, saved) ? fmu_take(fmu, function, &saved->state) : FMU_ERROR;
}

static int fmu_serialize(const fmu_instance *fmu, const char *function, const fmu_saved *saved, void *bytes,
                         size_t size) {
  if (size < sizeof *saved) {
    return fmu_refuse(fmu, "%s: %lu bytes do not hold a state of %lu", function, (unsigned long)size,
                      (unsigned long)sizeof *saved);
  }
  if (!fmu_possible(fmu, function, saved)) return FMU_ERROR;
  memcpy(bytes, saved, sizeof *saved);
  return FMU_OK;
}

static int fmu_deserialize(const fmu_instance *fmu, const char *function, const void *bytes, size_t size,
                           void **state) {
  fmu_saved saved, *copy;
  if (size != sizeof saved) {
    return fmu_refuse(fmu, "%s: %lu bytes, a state has %lu", function, (unsigned long)size,
                      (unsigned long)sizeof saved);
  }
  memcpy(&saved, bytes, sizeof saved);
  if (!fmu_possible(fmu, function, &saved)) return FMU_ERROR;
  copy = malloc(sizeof *copy);
  if (copy == NULL) return fmu_refuse(fmu, "%s: no memory", function);
  *copy = saved;
  *state = copy;
  return FMU_OK;
}
