/*
 * loop.c - fixed-step simulation of packs of runs; compiled together with its kernel.
 *
 * A pack is SL_G groups of SL_W lanes, a lane is one run; SL_PACKS packs go through time side by side. "kernel.h" comes
 * from a generator and provides
 *   sizes        SL_W SL_G SL_PACKS; SL_NJ joints, SL_NX states, the last SL_NZ of them the controller's, SL_NB base
 *                coordinates, SL_NF disturbance forces, SL_NTIP numbers of the tip, SL_NP parameters, SL_NR, SL_NU, SL_NV
 *                (values bound once per run; once per time and the same for all runs; once per time and run), SL_ND,
 *                SL_NTABLES; SL_SAMPLED, SL_SLIDING (whether the controller has a sliding variable) 0 or 1
 *   kernel_run, kernel_start, kernel_uniform, kernel_varying, kernel_signals; kernel_tip, for rows alone, where SL_NTIP > 0
 *   kernel_times, where SL_BLOCKED_TIMES: all that kernel_varying computes at the times of a step, in the common case
 *   the metrics: SL_METRICS_PER_JOINT, sl_sample, sl_metrics, kernel_sample, kernel_metrics_start, _sample and _finish
 *   SL_NMEASURED, SL_NNOISE, where sensors show at samples anything but the state: numbers that they show, and random
 *                numbers that they take
 *   SL_ACTUATED, SL_DELAY, SL_NM, where motors are not driven by the command as it is: most steps of delay, numbers that
 *                are remembered; kernel_actuate gives the forces at the nodes of a step
 *   kernel_closed (continuous control) or kernel_control, kernel_error, kernel_plant (sampled control)
 *   the integrator: SL_STAGES, SL_INSTANTS (times a step needs signals at, its end not counted), SL_KEPT (slopes that are
 *                needed for long), sl_node, sl_when, sl_kept, kernel_update
 * The controller's states go on with the plant's where control is continuous. Where it is sampled they are held, and at a
 * sample kernel_control gives what they are after the step that begins there: a row at a sample shows those that its
 * command was computed from.
 * Times are t = start + (k + c) h for step k and node c, never accumulated.
 */
#include <fenv.h>
#include <float.h>
#include <stddef.h>
#include <string.h>

#include "kernel.h"
#include "simulate.h"

#ifndef SL_NMEASURED
#define SL_NMEASURED 0
#define SL_NNOISE 0
#endif
#if SL_NNOISE > 0
#include "sl_noise.h"
#endif
#ifndef SL_ACTUATED
#define SL_ACTUATED 0
#define SL_COMMAND pack->u
#define SL_ACTING_AT(node) pack->u
#define SL_ACTING_GIVEN
#else
#define SL_COMMAND pack->command
#define SL_ACTING_AT(node) pack->acting[node]
#define SL_ACTING_GIVEN , pack->acting + chosen->instant
#endif
#ifndef SL_RUN_PERIOD /* what kernel_run is told of the sample period, where it has a use for it */
#define SL_RUN_PERIOD
#endif
#if SL_NMEASURED > 0
#define SL_NOISE_GIVEN (const sl_group *)pack->noise,
#define SL_MEASURED_TAKEN , pack->measured
#define SL_MEASURED_TAKEN_BY_BLOCK , (const sl_group *)pack->noise, pack->measured
#else
#define SL_NOISE_GIVEN
#define SL_MEASURED_TAKEN
#define SL_MEASURED_TAKEN_BY_BLOCK
#endif

enum {
  SL_PACK = SL_W * SL_G,
  SL_RUNS = SL_ALONE ? 1 : SL_PACK, /* of a pack, at most; the lanes behind the last repeat it */
  SL_NMETRICS = SL_NJ * SL_METRICS_PER_JOINT,
  SL_BLOCK = (SL_INSTANTS + SL_W - 1) / SL_W * SL_W, /* instants whose uniform signals are evaluated together */
  SL_NPLANT = SL_NX - SL_NZ,
  SL_NSIGMA = SL_NJ * SL_SLIDING,
  SL_NCOLUMNS = 1 + SL_NX + 3 * SL_NJ + SL_NSIGMA + SL_NB + SL_NF + SL_NTIP + SL_NMEASURED + SL_ACTUATED * SL_NJ
};

/* ---- signals ------------------------------------------------------------------------------------------- */

typedef struct {
  const sl_job *job;
  sl_v uniform[2][SL_BLOCK / SL_W][SL_NU + 1]; /* two blocks of instants, a lane each: those of a step are in no more */
  int64_t block[2];                            /* which blocks are held */
} sl_clock;

static double step_time(const sl_job *job, int64_t k) { return job->start_time + (double)k * job->step; }

/* Instants are counted over all steps: node m of step k is number k SL_INSTANTS + m. */
static double instant_time(const sl_job *job, int64_t j) {
  return job->start_time + ((double)(j / SL_INSTANTS) + sl_node[j % SL_INSTANTS]) * job->step;
}

/* Uniform signals at instant j: SL_NU values, SL_W doubles apart. */
static const double *uniform_at(sl_clock *clock, int64_t j) {
  const int64_t block = j / SL_BLOCK;
  const int slot = (int)(block & 1), lane = (int)(j % SL_BLOCK);
  if (SL_NU > 0 && clock->block[slot] != block) {
    int part, i;
    for (part = 0; part < SL_BLOCK / SL_W; part++) {
      double t[SL_W], d[SL_W * (SL_ND + 1)] = {0.0}; /* without tables nothing reads d */
      for (i = 0; i < SL_W; i++) {
        t[i] = instant_time(clock->job, block * SL_BLOCK + part * SL_W + i);
        sl_table_data(clock->job->tables, SL_NTABLES, t[i], d + i, SL_W);
      }
      kernel_uniform(t, d, clock->uniform[slot][part]);
    }
    clock->block[slot] = block;
  }
  return (const double *)clock->uniform[slot][lane / SL_W] + lane % SL_W;
}

/* ---- a pack of runs ------------------------------------------------------------------------------------ */

typedef struct {
  const sl_job *job;
  int64_t run[SL_PACK];            /* which run a lane is; the last pack repeats its last run */
  int lanes;                       /* lanes that count */
  int live;                        /* of these, still running */
  unsigned char alive[SL_PACK];
  sl_group p[SL_NP + 1], r[SL_NR + 1];
  sl_group u[SL_NJ], e[SL_NJ], sigma[SL_NJ];
  sl_group unseen[5][SL_NJ];
  sl_group wished[SL_NJ], a_law[SL_NJ]; /* u and the law before their limits, which turn what is no number into one */
  sl_group states[2][SL_NX];       /* x and next, in turn */
  sl_group *x, *next;              /* the state, and the next one as far as it is summed up */
  sl_group at[2][SL_NX];           /* where a stage is evaluated, in turn */
  sl_v gains[SL_GAINS + 1];        /* the integrator's factors times the step */
  sl_group kept[SL_KEPT + 1][SL_NX];              /* slopes of the stages that sl_kept names */
  sl_time times[SL_INSTANTS + 1];                 /* the nodes of the step, and its end */
  sl_group varying[SL_INSTANTS + 1][SL_NV + 1];   /* what varies at these times, in turn */
  sl_group low[SL_NJ], high[SL_NJ]; /* limits of q1, where the job has some; those of a lane that has ended are none */
#if SL_NMEASURED > 0
  sl_group noise[SL_NNOISE + 1], measured[SL_NMEASURED]; /* of the last sample */
#endif
#if SL_ACTUATED
  sl_group command[SL_NJ];                  /* of the controller; u is what acts */
  sl_group line[SL_DELAY + 1][SL_NJ];       /* commands that have not arrived, that of step k at k % delay */
  sl_group m[SL_NM + 1];                    /* what motors remember */
  sl_group acting[SL_INSTANTS + 1][SL_NJ];  /* at the nodes of the step, and at its end */
#endif
#if SL_NNOISE > 0
  sl_b number[SL_G]; /* that the noise of a run goes by */
#endif
  sl_group bands[SL_NBANDS]; /* of the metrics */
  int64_t samples;                  /* that the metrics have seen */
  sl_metrics metrics[SL_NJ][SL_G];
  sl_clock *clock;
} sl_pack;

static double lane_of(const sl_v *group, int lane) { return slv_get(group[lane / SL_W], lane % SL_W); }

static void set_lane(sl_v *group, int lane, double value) {
  group[lane / SL_W] = slv_put(group[lane / SL_W], lane % SL_W, value);
}

/* Instant j, whose signals are known for all runs, and for each after whoever has `varying` computes them. */
static sl_time instant_at(sl_pack *pack, int64_t j, sl_group *varying) {
  sl_time now;
  now.uniform = uniform_at(pack->clock, j);
  now.varying = (const sl_group *)varying;
  return now;
}

static sl_time time_at(sl_pack *pack, int64_t j, sl_group *varying) {
  const sl_time now = instant_at(pack, j, varying);
  if (SL_NV > 0) {
    double d[SL_ND + 1] = {0.0}; /* likewise */
    const double t = instant_time(pack->job, j);
    sl_table_data(pack->job->tables, SL_NTABLES, t, d, 1);
    kernel_varying(t, d, now.uniform, (const sl_group *)pack->p, (const sl_group *)pack->r, varying);
  }
  return now;
}

/* A trajectory row at step k for each living lane from `lane` to `end`-1. */
static void write_row(sl_pack *pack, int64_t k, sl_time now, int lane, int end) {
  const sl_job *job = pack->job;
  sl_group q1d[SL_NJ], b[SL_NB + SL_NF]; /* forces behind the base */
  int i;
#if SL_NTIP > 0
  sl_group tip[SL_NTIP];
  double d[SL_ND + 1] = {0.0}; /* likewise */
  sl_table_data(job->tables, SL_NTABLES, step_time(job, k), d, 1);
  kernel_tip(step_time(job, k), d, (const sl_group *)pack->x, (const sl_group *)pack->p, (const sl_group *)pack->r, tip);
#endif
  kernel_signals(now, (const sl_group *)pack->p, (const sl_group *)pack->r, q1d, b);
  for (; lane < end; lane++) {
    const int64_t run = pack->run[lane];
    double *row;
    if (!pack->alive[lane] || job->rows[run] >= job->capacity) continue;
    row = job->trajectory + (run * job->capacity + job->rows[run]++) * SL_NCOLUMNS;
    *row++ = step_time(job, k);
    for (i = 0; i < SL_NPLANT; i++) *row++ = lane_of(pack->x[i], lane);
    for (i = 0; i < SL_NJ; i++) *row++ = lane_of(q1d[i], lane);
    for (i = 0; i < SL_NJ; i++) *row++ = lane_of(pack->e[i], lane);
    for (i = 0; i < SL_NSIGMA; i++) *row++ = lane_of(pack->sigma[i], lane);
    for (i = 0; i < SL_NJ; i++) *row++ = lane_of(pack->u[i], lane);
    for (i = SL_NPLANT; i < SL_NX; i++) *row++ = lane_of(pack->x[i], lane);
    for (i = 0; i < SL_NB + SL_NF; i++) *row++ = lane_of(b[i], lane);
#if SL_NTIP > 0
    for (i = 0; i < SL_NTIP; i++) *row++ = lane_of(tip[i], lane);
#endif
#if SL_NMEASURED > 0
    for (i = 0; i < SL_NMEASURED; i++) *row++ = lane_of(pack->measured[i], lane);
#endif
#if SL_ACTUATED
    for (i = 0; i < SL_NJ; i++) *row++ = lane_of(pack->command[i], lane);
#endif
  }
}

static void set_limits(sl_pack *pack, int lane, const double *limits) {
  int i;
  for (i = 0; i < SL_NJ; i++) {
    set_lane(pack->low[i], lane, limits ? limits[2 * i] : -SL_INF);
    set_lane(pack->high[i], lane, limits ? limits[2 * i + 1] : SL_INF);
  }
}

/* Takes a lane out of the pack at step k: its result is what it is now. */
static void finish_lane(sl_pack *pack, int lane, int64_t k, enum sl_status status, int quantity) {
  const sl_job *job = pack->job;
  const int64_t run = pack->run[lane];
  const double end = step_time(job, k), half = (double)(job->steps - job->steps / 2) * job->step;
  const sl_span span = {job->start_time, end - job->start_time, half, job->step, status == SL_OK};
  const double *bands = job->bands + run * SL_NBANDS;
  double *metrics = job->metrics + run * SL_NMETRICS;
  int i;
  for (i = 0; i < SL_NX; i++) job->final_state[run * SL_NX + i] = lane_of(pack->x[i], lane);
  for (i = 0; i < SL_NMETRICS; i++) metrics[i] = SL_NAN;
  for (i = 0; i < SL_NJ && pack->samples > 0; i++) {
    kernel_metrics_finish(&pack->metrics[i][lane / SL_W], lane % SL_W, span, bands, metrics + i * SL_METRICS_PER_JOINT);
  }
  job->end_time[run] = end;
  job->status[run] = (int32_t)status;
  job->quantity[run] = quantity;
  pack->alive[lane] = 0;
  pack->live--;
  if (job->limits) set_limits(pack, lane, NULL);
}

/* The first joint of a lane whose next position is beyond its limits; SL_NJ if there is none. */
static int beyond_limits(const sl_pack *pack, int lane) {
  int i;
  for (i = 0; pack->job->limits && i < SL_NJ; i++) {
    const double q = lane_of(pack->next[i], lane);
    if (q < lane_of(pack->low[i], lane) || q > lane_of(pack->high[i], lane)) return i;
  }
  return SL_NJ;
}

/*
 * Ends the runs whose next state is not finite, out of bounds or beyond the joints' limits; they keep the state of step k. Their lanes go on from
 * zero, so that what they compute stays harmless.
 */
static void stop_runaways(sl_pack *pack, int64_t k, double bound) {
  const int between_rows = pack->job->output_every > 0 && k % pack->job->output_every != 0;
  int lane, i, bad;
  for (lane = 0; lane < SL_PACK; lane++) {
    enum sl_status status = SL_OUT_OF_LIMITS;
    for (bad = 0; bad < SL_NX && sl_fabs(lane_of(pack->next[bad], lane)) <= bound; bad++) continue;
    if (bad < SL_NX) {
      status = sl_fabs(lane_of(pack->next[bad], lane)) <= DBL_MAX ? SL_OUT_OF_BOUNDS : SL_DIVERGED;
    } else if ((bad = beyond_limits(pack, lane)) == SL_NJ) {
      continue;
    }
    if (pack->alive[lane]) {
      if (between_rows) write_row(pack, k, pack->times[0], lane, lane + 1);
      finish_lane(pack, lane, k, status, bad < SL_NPLANT ? bad : bad + 3 * SL_NJ + SL_NSIGMA);
    }
    for (i = 0; i < SL_NX; i++) set_lane(pack->next[i], lane, 0.0);
#if SL_ACTUATED
    for (i = 0; i < SL_NM; i++) set_lane(pack->m[i], lane, 0.0);
    for (i = 0; i < SL_NJ; i++) set_lane(pack->command[i], lane, 0.0);
    for (i = 0; i < SL_DELAY * SL_NJ; i++) set_lane(pack->line[i / SL_NJ][i % SL_NJ], lane, 0.0);
#endif
  }
}

/* Whether what the control computed is finite in all lanes: if the sum is, all of it is. */
static int control_is_finite(const sl_pack *pack) {
  const sl_v limit = slv_set(DBL_MAX);
  sl_m finite = slv_yes();
  int i, g;
  for (g = 0; g < SL_G; g++) {
    sl_v sum = slv_set(0.0);
    for (i = 0; i < SL_NJ; i++) sum = sum + pack->e[i][g] + pack->sigma[i][g] + pack->wished[i][g] + pack->a_law[i][g];
    finite = finite & (slv_fabs(sum) <= limit);
  }
  return slv_all(finite);
}

/* Ends the runs whose control is not finite at step k; they keep the state it was computed from. */
SL_RARE void stop_overflows(sl_pack *pack, int64_t k, sl_time now) {
  enum { KINDS = 4, ROW = SL_NCOLUMNS - 1 };
  const sl_group *const computed[KINDS] = {pack->e, pack->sigma, pack->a_law, pack->wished};
  static const int place[KINDS] = {SL_NPLANT + SL_NJ, SL_NPLANT + 2 * SL_NJ, ROW, SL_NPLANT + 2 * SL_NJ + SL_NSIGMA};
  /* a_law is in no row */
  int lane, bad, i;
  for (lane = 0; lane < pack->lanes; lane++) {
    if (!pack->alive[lane]) continue;
    for (bad = 0; bad < KINDS * SL_NJ; bad++) {
      if (!sl_isfinite(lane_of(computed[bad / SL_NJ][bad % SL_NJ], lane))) break;
    }
    if (bad == KINDS * SL_NJ) continue;
    for (i = 0; i < SL_NJ; i++) { /* no command is applied any more: the row shows what was wished */
      const double wished = lane_of(pack->wished[i], lane);
      if (!sl_isfinite(wished)) set_lane(pack->u[i], lane, wished);
    }
    if (pack->job->output_every > 0) write_row(pack, k, now, lane, lane + 1);
    finish_lane(pack, lane, k, SL_DIVERGED, place[bad / SL_NJ] + bad % SL_NJ);
  }
}

/* Metrics and trajectory at step k, where e, sigma, u belong to x. */
static void observe(sl_pack *pack, int64_t k, sl_time now) {
  const sl_job *job = pack->job;
  const int64_t middle = job->steps / 2, last = job->steps;
  const sl_instant instant = {step_time(job, k), k > 0, k >= middle, k > middle, 4 * k >= 3 * last, 4 * (k - 1) >= 3 * last};
  const sl_group *x = (const sl_group *)pack->x, *u = (const sl_group *)pack->u, *e = (const sl_group *)pack->e;
  const sl_group *sigma = (const sl_group *)pack->sigma;
  int i, g;
  for (i = 0; k == 0 && i < SL_NJ; i++) {
    for (g = 0; g < SL_G; g++) {
      kernel_metrics_start(&pack->metrics[i][g], kernel_sample(x, u, e, sigma, i, g), (const sl_group *)pack->bands, g);
    }
  }
  if (!control_is_finite(pack)) stop_overflows(pack, k, now);
  for (i = 0; i < SL_NJ; i++) {
    for (g = 0; g < SL_G; g++) {
      kernel_metrics_sample(&pack->metrics[i][g], instant, kernel_sample(x, u, e, sigma, i, g));
    }
  }
  pack->samples = k + 1;
  if (job->output_every > 0 && (k % job->output_every == 0 || k == job->steps)) write_row(pack, k, now, 0, pack->lanes);
}

#if SL_SAMPLED
#if SL_NNOISE > 0
static const unsigned sl_noise_pairs[] = SL_NOISE_PAIRS; /* of each block of four, those that a sensor shows */

/* Random numbers of step k, where that is a sample. */
static void draw_noise(sl_pack *pack, int64_t k) {
  const sl_b none = {0};
  int block, i, g;
  if (k % pack->job->hold != 0) return;
  for (g = 0; g < SL_G; g++) {
    for (block = 0; 4 * block < SL_NNOISE; block++) {
      sl_v z[4];
      slv_noise(none + (uint64_t)pack->job->seed, pack->number[g], none + (uint64_t)(k / pack->job->hold),
                none + (uint64_t)block, sl_noise_pairs[block], z);
      for (i = 0; i < 4 && 4 * block + i < SL_NNOISE; i++) {
        if (sl_noise_pairs[block] >> (i / 2) & 1) pack->noise[4 * block + i][g] = z[i];
      }
    }
  }
}
#endif

/* Control of step k: a new sample, or the held one with its error and sliding variable. */
static void sample_control(sl_pack *pack, int64_t k, sl_time now) {
  const sl_group *x = (const sl_group *)pack->x, *p = (const sl_group *)pack->p, *r = (const sl_group *)pack->r;
  if (k % pack->job->hold == 0) {
#if SL_NZ > 0
    const double period = (double)pack->job->hold * pack->job->step;
    kernel_control(now, x, SL_NOISE_GIVEN period, p, r, SL_COMMAND, pack->e, pack->sigma, pack->wished,
                   pack->a_law SL_MEASURED_TAKEN, pack->next + SL_NPLANT);
#else
    kernel_control(now, x, SL_NOISE_GIVEN p, r, SL_COMMAND, pack->e, pack->sigma, pack->wished,
                   pack->a_law SL_MEASURED_TAKEN);
#endif
  } else {
    kernel_error(now, x, p, r, pack->e, pack->sigma);
#if SL_NZ > 0
    memcpy(pack->next + SL_NPLANT, x + SL_NPLANT, SL_NZ * sizeof(sl_group)); /* held */
#endif
  }
}
#endif

#if SL_ACTUATED
/* Of step k: its sample, if it has one, and what the motors are driven by at its nodes. */
static void drive_motors(sl_pack *pack, int64_t k, sl_time now) {
  const sl_group *arrived = (const sl_group *)pack->command;
#if SL_DELAY > 0
  sl_group late[SL_NJ];
  int64_t place;
#endif
  if (k % pack->job->hold == 0) {
    int fine = 0;
#if SL_BLOCKED
    const sl_group *x = (const sl_group *)pack->x;
    sl_group unused[SL_NX];
    fine = sl_take.compute(&now, (const sl_v *)pack->gains, (double)pack->job->hold * pack->job->step,
                           (const sl_group *)pack->p, (const sl_group *)pack->r, x,
                           (const sl_group *)pack->at[1], pack->next, pack->at[0], pack->kept, unused, pack->command, pack->e, pack->sigma, pack->wished,
                           pack->a_law SL_MEASURED_TAKEN_BY_BLOCK, pack->acting);
#endif
    if (!fine) sample_control(pack, k, now);
  }
#if SL_DELAY > 0
  place = k % pack->job->delay;
  memcpy(late, pack->line[place], sizeof late);
  memcpy(pack->line[place], pack->command, sizeof late);
  arrived = (const sl_group *)late;
#endif
  /* m is read before it is written */
  kernel_actuate(pack->job->step, arrived, (const sl_group *)pack->m, (const sl_group *)pack->p,
                 (const sl_group *)pack->r, pack->acting[0], pack->m);
  memcpy(pack->u, pack->acting[0], sizeof pack->u);
}
#endif

/* A stage of step k by the complete functions; e, sigma and u become those at the start of the step. */
static void run_stage(sl_pack *pack, int64_t k, int stage, const sl_group *from, sl_group *slope) {
  const sl_group *x = (const sl_group *)pack->x, *p = (const sl_group *)pack->p, *r = (const sl_group *)pack->r;
  const sl_group *at = stage == 0 ? x : from;
#if SL_SAMPLED
  if (stage == 0 && (!SL_ACTUATED || k % pack->job->hold != 0)) sample_control(pack, k, pack->times[0]);
  kernel_plant(pack->times[sl_when[stage]], at, (const sl_group *)SL_ACTING_AT(sl_when[stage]), p, r, slope);
#else
  (void)k;
  if (stage == 0) {
    kernel_closed(pack->times[0], at, p, r, slope, pack->u, pack->e, pack->sigma, pack->wished, pack->a_law);
  } else {
    sl_group u[SL_NJ], e[SL_NJ], sigma[SL_NJ], wished[SL_NJ], a_law[SL_NJ];
    kernel_closed(pack->times[sl_when[stage]], at, p, r, slope, u, e, sigma, wished, a_law);
  }
#endif
}

/* A block of stages; where a rare case is met, they are computed again by the complete functions. */
static void run_block(sl_pack *pack, int64_t k, int block) {
  const sl_group *x = (const sl_group *)pack->x;
  sl_group *from = pack->at[block & 1], *to = pack->at[(block + 1) & 1], once[SL_NX];
  int stage = block * SL_PER_BLOCK, end = stage + SL_PER_BLOCK, fine = 0;
#if SL_NNOISE > 0
  if (block == 0) draw_noise(pack, k);
#endif
#if SL_ACTUATED
  if (block == 0) drive_motors(pack, k, pack->times[0]);
#endif
#if SL_BLOCKED
  const sl_block *chosen = SL_SAMPLED && block == 0 && k % pack->job->hold != 0 ? &SL_HELD : &sl_blocks[block];
  const int seen = block == 0 || SL_SAMPLED; /* what later stages compute of the control is only theirs */
  fine = chosen->compute(pack->times + chosen->instant, (const sl_v *)pack->gains + chosen->gain,
                         (double)pack->job->hold * pack->job->step, (const sl_group *)pack->p,
                         (const sl_group *)pack->r, x, block == 0 ? x : (const sl_group *)from, pack->next, to,
                         pack->kept, sl_kept[stage] < 0 ? once : pack->kept[sl_kept[stage]],
                         seen ? pack->u : pack->unseen[0], seen ? pack->e : pack->unseen[1],
                         seen ? pack->sigma : pack->unseen[2], seen ? pack->wished : pack->unseen[3],
                         seen ? pack->a_law : pack->unseen[4] SL_MEASURED_TAKEN_BY_BLOCK SL_ACTING_GIVEN);
#endif
  if (!SL_LIKELY(fine && SL_FUSED)) {
    for (; stage < end; stage++, from = to) {
      sl_group *slope = sl_kept[stage] < 0 ? once : pack->kept[sl_kept[stage]];
      if (!fine) run_stage(pack, k, stage, (const sl_group *)from, slope);
      kernel_update(stage, pack->job->step, x, slope, pack->kept, pack->next, to);
    }
  }
  if (block == 0) observe(pack, k, pack->times[0]);
}

/* e, sigma and u at the end of the run. */
static void control_at_end(sl_pack *pack, int64_t k, sl_time now) {
#if SL_SAMPLED
#if SL_NNOISE > 0
  draw_noise(pack, k);
#endif
#if SL_ACTUATED
  drive_motors(pack, k, now);
  if (k % pack->job->hold != 0)
#endif
    sample_control(pack, k, now);
#else
  sl_group slope[SL_NX];
  kernel_closed(now, (const sl_group *)pack->x, (const sl_group *)pack->p, (const sl_group *)pack->r, slope, pack->u,
                pack->e, pack->sigma, pack->wished, pack->a_law);
  (void)k;
#endif
}

static void load_pack(sl_pack *pack, const sl_job *job, int64_t first, sl_clock *clock) {
  double d[SL_ND + 1] = {0.0}; /* without tables nothing reads it */
  int lane, i;
  pack->job = job;
  pack->clock = clock;
  pack->x = pack->states[0];
  pack->next = pack->states[1];
  pack->lanes = (int)(job->last - first < SL_RUNS ? job->last - first : SL_RUNS);
  pack->live = pack->lanes;
  pack->samples = 0;
  for (lane = 0; lane < SL_PACK; lane++) {
    const int64_t run = first + (lane < pack->lanes ? lane : pack->lanes - 1);
    pack->run[lane] = run;
    pack->alive[lane] = lane < pack->lanes;
    for (i = 0; i < SL_NP; i++) set_lane(pack->p[i], lane, job->parameters[run * SL_NP + i]);
    for (i = 0; i < SL_NBANDS; i++) set_lane(pack->bands[i], lane, job->bands[run * SL_NBANDS + i]);
    if (lane < pack->lanes && job->rows) job->rows[run] = 0;
#if SL_NNOISE > 0
    SL_LANE(pack->number[lane / SL_W], lane % SL_W) = job->numbers ? (uint64_t)job->numbers[run] : 0;
#endif
    if (job->limits) set_limits(pack, lane, lane < pack->lanes ? job->limits : NULL);
  }
#if SL_BLOCKED
  for (i = 0; i < SL_GAINS; i++) pack->gains[i] = slv_set(sl_gain[i] * job->step);
#endif
#if SL_ACTUATED
  memset(pack->command, 0, sizeof pack->command);
  memset(pack->line, 0, sizeof pack->line);
  memset(pack->m, 0, sizeof pack->m);
  kernel_run((const sl_group *)pack->p, job->step SL_RUN_PERIOD, pack->r);
#else
  kernel_run((const sl_group *)pack->p SL_RUN_PERIOD, pack->r);
#endif
  sl_table_data(job->tables, SL_NTABLES, job->start_time, d, 1);
  kernel_start(job->start_time, d, (const sl_group *)pack->p, (const sl_group *)pack->r, pack->x);
  pack->times[0].varying = (const sl_group *)pack->varying[0];
  pack->times[SL_INSTANTS] = time_at(pack, 0, pack->varying[SL_INSTANTS]);
}

static int within(const sl_group *x, double bound) {
  const sl_v limit = slv_set(bound);
  sl_m inside = slv_fabs(x[0][0]) <= limit;
  int i, g;
  for (i = 0; i < SL_NX; i++) {
    for (g = 0; g < SL_G; g++) inside = inside & (slv_fabs(x[i][g]) <= limit);
  }
  return slv_all(inside);
}

static int within_limits(const sl_pack *pack) {
  const sl_group *q = (const sl_group *)pack->next;
  sl_m inside = slv_yes();
  int i, g;
  for (i = 0; i < SL_NJ; i++) {
    for (g = 0; g < SL_G; g++) inside = inside & (q[i][g] >= pack->low[i][g]) & (q[i][g] <= pack->high[i][g]);
  }
  return slv_all(inside);
}

/* What was the end of a step becomes the beginning of step k, and the signals at its other times become known. */
static void begin_step(sl_pack *pack, int64_t k) {
  sl_group *varying[SL_INSTANTS];
  int m;
  for (m = 1; m < SL_INSTANTS; m++) varying[m - 1] = pack->varying[m];
  varying[SL_INSTANTS - 1] = (sl_group *)pack->times[0].varying;
  pack->times[0] = pack->times[SL_INSTANTS];
#if SL_BLOCKED_TIMES
  {
    double t[SL_INSTANTS], d[SL_INSTANTS][SL_ND + 1] = {{0.0}}; /* likewise */
    for (m = 1; m <= SL_INSTANTS; m++) {
      t[m - 1] = instant_time(pack->job, k * SL_INSTANTS + m);
      sl_table_data(pack->job->tables, SL_NTABLES, t[m - 1], d[m - 1], 1);
      pack->times[m] = instant_at(pack, k * SL_INSTANTS + m, varying[m - 1]);
    }
    if (SL_LIKELY(kernel_times(t, (const double(*)[SL_ND + 1])d, pack->times + 1, (const sl_group *)pack->p,
                               (const sl_group *)pack->r, varying))) {
      return;
    }
  }
#endif
  for (m = 1; m <= SL_INSTANTS; m++) pack->times[m] = time_at(pack, k * SL_INSTANTS + m, varying[m - 1]);
}

static void end_step(sl_pack *pack, int64_t k, double bound) {
  sl_group *next = pack->next;
  if (!within((const sl_group *)next, bound) || (pack->job->limits && !within_limits(pack))) stop_runaways(pack, k, bound);
  pack->next = pack->x;
  pack->x = next;
}

/* What is left after step k - 1, the last. */
static void end_runs(sl_pack *pack, int64_t k) {
  const enum sl_status status = k == pack->job->steps ? SL_OK : SL_STOPPED;
  int lane;
  control_at_end(pack, k, pack->times[SL_INSTANTS]);
  observe(pack, k, pack->times[SL_INSTANTS]);
  for (lane = 0; lane < pack->lanes; lane++) {
    if (pack->alive[lane]) finish_lane(pack, lane, k, status, -1);
  }
}

/* Packs side by side, stage by stage: while one waits for the results of its last stage, another has work to do. */
static void run_packs(sl_pack *packs, int count, const sl_job *job) {
  const double bound = sl_fmin(job->bound, DBL_MAX);
  int64_t k, reported = 0, runs = 0;
  int block, i, live = 1;
  for (i = 0; i < count; i++) runs += packs[i].lanes;
  for (k = 0; k < job->steps && live > 0; k++) {
    for (i = 0; i < count; i++) {
      if (packs[i].live > 0) begin_step(&packs[i], k);
    }
#pragma GCC unroll 1
    for (block = 0; block < SL_BLOCKS; block++) {
      for (i = 0; i < count; i++) {
        if (packs[i].live > 0) run_block(&packs[i], k, block);
      }
    }
    for (i = live = 0; i < count; i++) {
      if (packs[i].live > 0) end_step(&packs[i], k, bound);
      live += packs[i].live;
    }
    if ((k + 1) % 4096 == 0) {
      if (job->progress) {
        __atomic_fetch_add(job->progress, (k + 1 - reported) * runs, __ATOMIC_RELAXED);
        reported = k + 1;
      }
      if (job->stop && *job->stop) {
        k++;
        break;
      }
    }
  }
  if (job->progress) __atomic_fetch_add(job->progress, (job->steps - reported) * runs, __ATOMIC_RELAXED);
  for (i = 0; i < count; i++) {
    if (packs[i].live > 0) end_runs(&packs[i], k);
  }
}

/* ---- entry points -------------------------------------------------------------------------------------- */

/*
 * How many runs go side by side, and the sizes that a caller must have the same, in the order of _LAYOUT in compiled.py: of
 * sl_job and sl_table in bytes, of what a run takes and gives in numbers. Writes no more than `room` of them, and returns
 * how many there are.
 */
__attribute__((visibility("default"))) int64_t springline_layout(int64_t *layout, int64_t room) {
  static const int64_t sizes[] = {SL_RUNS * SL_PACKS, sizeof(sl_job), sizeof(sl_table), SL_NP,       SL_NBANDS,
                                  SL_NTABLES,         SL_NX,          SL_NMETRICS,      SL_NCOLUMNS, SL_STATUSES};
  const int64_t count = sizeof sizes / sizeof *sizes;
  int64_t i;
  for (i = 0; i < count && i < room; i++) layout[i] = sizes[i];
  return count;
}

__attribute__((visibility("default"))) void springline_simulate(const sl_job *job) {
  sl_pack packs[SL_PACKS];
  sl_clock clock;
  fenv_t environment; /* whoever else is in this process may have set another rounding, or denormal numbers to zero */
  int64_t first = job->first;
  fegetenv(&environment);
  fesetenv(FE_DFL_ENV);
  clock.job = job;
  while (first < job->last) {
    int count;
    clock.block[0] = clock.block[1] = -1;
    for (count = 0; count < SL_PACKS && first < job->last; count++, first += SL_RUNS) {
      load_pack(&packs[count], job, first, &clock);
    }
    run_packs(packs, count, job);
  }
  fesetenv(&environment);
}
