/*
 * Two rates, two threads: how a real controller embeds the export.
 *
 * The control thread runs at 1 kHz, never waits for anybody and never allocates: it takes the newest reference, carries
 * it on to its own time, computes and applies the command, and leaves a record. The supervisor runs at 50 Hz: it plans the
 * reference and looks through the records. Between them are two rings with one writer and one reader each.
 *
 * The plant stands for the machine, and its clock for the timer interrupt: a control step is due when the clock says so.
 * Usage: two_rate [seconds = 1]
 */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "springline.h"

enum { CONTROL_HZ = 1000, SUPERVISOR_EVERY = 20, PLANT_STEPS = 10, REFERENCES = 8, RECORDS = 256 };

typedef struct {
  double time;
  springline_reference at_time;
} planned;

typedef struct {
  double time;
  int status;
  springline_command command;
  springline_diagnostics diagnostics;
} record;

/* One writer, one reader: `written` belongs to the writer, `read` to the reader, both only grow. */
typedef struct {
  atomic_uint written, read;
} ring;

static int can_write(ring *r, unsigned size) {
  return atomic_load_explicit(&r->written, memory_order_relaxed) - atomic_load_explicit(&r->read, memory_order_acquire) <
         size;
}
static int can_read(ring *r) {
  return atomic_load_explicit(&r->read, memory_order_relaxed) != atomic_load_explicit(&r->written, memory_order_acquire);
}
static unsigned write_place(ring *r) { return atomic_load_explicit(&r->written, memory_order_relaxed); }
static unsigned read_place(ring *r) { return atomic_load_explicit(&r->read, memory_order_relaxed); }
static void wrote(ring *r) { atomic_fetch_add_explicit(&r->written, 1, memory_order_release); }
static void took(ring *r) { atomic_fetch_add_explicit(&r->read, 1, memory_order_release); }

static struct {
  springline_controller controller;
  ring reference_ring, record_ring;
  planned references[REFERENCES];
  record records[RECORDS];
  atomic_long lost;        /* records that found no room */
  atomic_int finished;     /* set by the control thread */
  long samples;
} shared;

/* A reference carried on by `dt` with its own rate and acceleration. */
static springline_reference carried_on(const planned *from, double t) {
  const double dt = t - from->time;
  springline_reference to = from->at_time;
  to.q1d_lift += dt * (to.dq1d_lift + 0.5 * dt * to.ddq1d_lift);
  to.q1d_rotation += dt * (to.dq1d_rotation + 0.5 * dt * to.ddq1d_rotation);
  to.dq1d_lift += dt * to.ddq1d_lift;
  to.dq1d_rotation += dt * to.ddq1d_rotation;
  return to;
}

static void wait_until(struct timespec *due) {
  due->tv_nsec += 1000000000L / CONTROL_HZ;
  if (due->tv_nsec >= 1000000000L) {
    due->tv_nsec -= 1000000000L;
    due->tv_sec++;
  }
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, due, NULL);
}

static void *control_thread(void *unused) {
  springline_state arm;
  planned newest = {0};
  struct timespec due;
  long k;
  int j, planned_once = 0;
  (void)unused;
  springline_start(&shared.controller, &arm);
  clock_gettime(CLOCK_MONOTONIC, &due);
  for (k = 0; k < shared.samples; wait_until(&due)) {
    const double t = (double)k / CONTROL_HZ;
    springline_measurement measurement;
    springline_reference reference;
    record now;
    while (can_read(&shared.reference_ring)) {
      const planned *next = &shared.references[read_place(&shared.reference_ring) % REFERENCES];
      if (planned_once && next->time > t) break; /* of a later time */
      newest = *next;
      planned_once = 1;
      took(&shared.reference_ring);
    }
    if (!planned_once) continue; /* the supervisor has not planned yet */

    measurement.q1_lift = arm.q1_lift;
    measurement.q1_rotation = arm.q1_rotation;
    measurement.dq1_lift = arm.dq1_lift;
    measurement.dq1_rotation = arm.dq1_rotation;
    measurement.dq2_lift = arm.dq2_lift;
    measurement.dq2_rotation = arm.dq2_rotation;
    reference = carried_on(&newest, t);
    now.time = t;
    now.status = springline_step(&shared.controller, &reference, &measurement, &now.command, &now.diagnostics);
    for (j = 0; j < PLANT_STEPS; j++) {
      springline_plant_step(&shared.controller, &arm, &now.command, NULL, 1.0 / CONTROL_HZ / PLANT_STEPS);
    }

    if (can_write(&shared.record_ring, RECORDS)) {
      shared.records[write_place(&shared.record_ring) % RECORDS] = now;
      wrote(&shared.record_ring);
    } else {
      atomic_fetch_add(&shared.lost, 1);
    }
    k++;
  }
  atomic_store(&shared.finished, 1);
  return NULL;
}

int main(int argc, char **argv) {
  const double seconds = argc > 1 ? strtod(argv[1], NULL) : 1.0;
  const struct timespec pause = {0, 1000000000L / CONTROL_HZ * SUPERVISOR_EVERY / 4};
  pthread_t thread;
  long plans = 0, seen = 0, faults = 0;
  double late_error = 0.0;
  int done = 0;
  if (springline_init(&shared.controller, &springline_default_config) != SPRINGLINE_OK) return 1;
  shared.samples = (long)(seconds * CONTROL_HZ);
  if (pthread_create(&thread, NULL, control_thread, NULL) != 0) return 1;
  while (!done) {
    done = atomic_load(&shared.finished); /* before the last look at the records */
    while (can_write(&shared.reference_ring, REFERENCES)) { /* plan ahead as far as there is room */
      planned *next = &shared.references[write_place(&shared.reference_ring) % REFERENCES];
      springline_base base;
      next->time = (double)(plans * SUPERVISOR_EVERY) / CONTROL_HZ;
      if (springline_signals(&shared.controller, next->time, &next->at_time, &base) != SPRINGLINE_OK) return 1;
      wrote(&shared.reference_ring);
      plans++;
    }
    while (can_read(&shared.record_ring)) {
      const record *one = &shared.records[read_place(&shared.record_ring) % RECORDS];
      seen++;
      if (one->status != SPRINGLINE_OK) faults++;
      if (one->time >= 0.5 * seconds) late_error = fmax(late_error, fabs(one->diagnostics.e_lift));
      took(&shared.record_ring);
    }
    nanosleep(&pause, NULL);
  }
  pthread_join(thread, NULL);
  printf("%ld control steps seen, %ld lost, %ld faults; references planned at 50 Hz; largest late lift error %.2e m\n", seen,
         atomic_load(&shared.lost), faults, late_error);
  return faults == 0 && seen + atomic_load(&shared.lost) == shared.samples && late_error < 1e-3 ? 0 : 1;
}
