/*
 * state.h - what an instance is, and where it stands in time.
 *
 * fmu_model.h, before it, says what variables there are: a value reference is an index into `values`. controller.c,
 * or plant.c or loop.c and stepping.c, come after it and say what a part does:
 *
 *   fmu_begin     sets the initial state
 *   fmu_evaluate  sets the outputs of this time
 *   fmu_advance   goes on to a later place
 *
 * Each returns a status of springline.h. instance.h, after them, is what an importer deals with.
 */
#include <string.h>

/* What an instance may be asked to restore: one structure without pointers, no byte of which is padding. */
typedef struct {
  double values[FMU_VALUES];
  double start, stop; /* of the experiment, s as the importer counts them */
  double clock;       /* this communication point, s as the importer counts them */
  double time;        /* the same, s since the start: what signals, tables and samples go by */
  int64_t step;       /* grid points of step or sample period passed since the start */
  int64_t between;    /* 1: time is between two grid points */
  int64_t calls;      /* communication steps so far */
  int64_t has_stop;
  int64_t mode;
} fmu_state;

typedef struct {
  fmu_state now;
  springline_controller controller; /* has the parameters of `now` */
} fmu_core;

/* ---- time -------------------------------------------------------------------------------------------------- */

/* A time since the start: grid point number `step`, or between that one and the next. */
typedef struct {
  double time;
  int64_t step;
  int between;
} fmu_place;

/* A step of the integrator. */
typedef struct {
  double t[3]; /* start, middle, end */
  double length;
} fmu_interval;

/* Time of half grid step j, as in the simulation loop: never accumulated. */
static double fmu_grid_time(int64_t j) { return (0.5 * (double)j) * FMU_GRID; }

/* From |t| to the next double. */
static double fmu_spacing(double t) {
  const double from = sl_fabs(t);
  return sl_real(sl_bits(from) + 1) - from;
}

/* What fractions of a time are counted in: the grid, or the communication step where there is none. */
static double fmu_unit(double length) { return FMU_GRID > 0.0 ? FMU_GRID : length; }

/* Whether doubles around t are fine enough for the grid: at most 1 % of a step apart. */
static int fmu_resolves(double t) { return FMU_GRID <= 0.0 || fmu_spacing(t) <= 0.01 * FMU_GRID; }

/* How far two times near t may be apart and still be meant to be one: a difference of two rounded times is off by as
 * much as two spacings. Never more than 2.1 % of a step. */
static double fmu_tolerance(double t, double unit) { return 1e-3 * unit + 2.0 * fmu_spacing(t); }

/* How far the importer's clock may be off if it adds up its steps: each sum is rounded. */
static double fmu_drift(const fmu_state *now, double t, double unit) {
  return fmu_tolerance(t, unit) + 0.5 * (double)(now->calls + 1) * fmu_spacing(t);
}

/*
 * Where a communication step of `length` to the importer's time `until` ends.
 *
 * The length is added to the time since the start, which is on the grid and exact, as long as rounding explains where
 * the importer's clock is; if not, the clock counts. What comes out is the next grid point if it is within tolerance.
 * So importers that add up absolute times stay on the grid: at Unix times, 2.4e-7 s apart, their sum of a thousand
 * milliseconds is wrong by up to 1.2e-4 s, and the difference to the start alone would soon miss the samples.
 */
static fmu_place fmu_destination(const fmu_state *now, double length, double until) {
  const double unit = fmu_unit(length), tolerance = fmu_tolerance(until, unit);
  const double by_clock = until - now->start, by_length = now->time + length;
  const double time = sl_fabs(by_length - by_clock) <= fmu_drift(now, until, unit) ? by_length : by_clock;
  fmu_place place = {time, 0, 0};
  if (FMU_GRID > 0.0) {
    const double nearest = sl_floor(time / FMU_GRID + 0.5);
    if (sl_fabs(time - nearest * FMU_GRID) <= tolerance) {
      place.step = (int64_t)nearest;
      place.time = fmu_grid_time(2 * place.step);
    } else {
      place.step = (int64_t)sl_floor(time / FMU_GRID);
      place.between = 1;
    }
  }
  if (place.time <= now->time) { /* less than a tolerance on: nowhere else */
    place.time = now->time;
    place.step = now->step;
    place.between = (int)now->between;
  }
  return place;
}

static void fmu_arrive(fmu_state *now, const fmu_place *place) {
  now->time = place->time;
  now->step = place->step;
  now->between = place->between;
}
