/*
 * What a step costs: instructions (qemu -icount shift=0 runs one a nanosecond, and SysTick counts every 40th) and the
 * stack below the caller, found by painting it. The inputs are those of a closed loop of one second at 1 kHz.
 */
#include <stdint.h>
#include <stdio.h>

#include "springline.h"

#ifndef SAMPLES
#define SAMPLES 1000
#endif

enum { STEPS_PER_SAMPLE = 10, INSTRUCTIONS_PER_TICK = 40, PAINTED = 8192, PAINT = 0x5a };

static volatile uint32_t *const systick = (volatile uint32_t *)0xE000E010u; /* control, reload, value */

static uint32_t ticks(void) { return 0xFFFFFFu - systick[2]; }

typedef struct {
  uint32_t total, most, count;
  unsigned stack;
} cost;

static void count(cost *of, uint32_t start) {
  const uint32_t spent = (ticks() - start) & 0xFFFFFFu;
  of->total += spent;
  of->count++;
  if (spent > of->most) of->most = spent;
}

/* Bytes below the caller's frame, deepest first. */
static volatile unsigned char *below(void) {
  volatile unsigned char *here;
  __asm__ volatile("mov %0, sp" : "=r"(here));
  return here - PAINTED;
}

static __attribute__((noinline)) void paint(void) {
  volatile unsigned char *at = below();
  int i;
  for (i = 0; i < PAINTED - 64; i++) at[i] = PAINT;
}

static __attribute__((noinline)) unsigned used(void) {
  volatile unsigned char *at = below();
  unsigned i = 0;
  while (i < PAINTED && at[i] == PAINT) i++;
  return PAINTED - i;
}

static springline_controller controller;
static springline_state state;
static springline_measurement measurement;
static springline_reference reference;
static springline_command command;
static springline_base base;
static springline_diagnostics diagnostics;

static springline_base *no_base = 0;

static int loop(cost *control, cost *plant, int with_stack) {
  const springline_real period = (springline_real)1 / 1000, step = period / STEPS_PER_SAMPLE;
  int k, j, status = springline_init(&controller, &springline_default_config);
  if (status == SPRINGLINE_OK) status = springline_start(&controller, &state);
  for (k = 0; k < SAMPLES && status == SPRINGLINE_OK; k++) {
    uint32_t start;
    unsigned bytes;
    status = springline_signals(&controller, (springline_real)k * period, &reference, &base);
    status |= springline_measure(&controller, &state, &measurement);
    if (with_stack) paint();
    start = ticks();
    status |= springline_step(&controller, &reference, &measurement, &command, &diagnostics);
    count(control, start);
    if (with_stack) {
      bytes = used();
      if (bytes > control->stack) control->stack = bytes;
    }
    for (j = 0; j < STEPS_PER_SAMPLE && status == SPRINGLINE_OK; j++) {
      if (with_stack) paint();
      start = ticks();
      status = springline_plant_step(&controller, &state, &command, no_base, step);
      count(plant, start);
      if (with_stack) {
        bytes = used();
        if (bytes > plant->stack) plant->stack = bytes;
      }
    }
  }
  return status;
}

/* Whether a tick is what it is taken for: two instructions, 40000 times. */
static int tick_is_right(void) {
  const uint32_t start = ticks();
  uint32_t left = 40000, spent;
  __asm__ volatile("1: subs %0, %0, #1\n\tbne 1b" : "+r"(left) : : "cc");
  spent = (ticks() - start) & 0xFFFFFFu;
  return spent > 1990 && spent < 2010;
}

static void print(const char *name, const cost *speed, const cost *room) {
  printf("%-13s mean %6lu  most %6lu instructions   stack %4u bytes\n", name,
         (unsigned long)((uint64_t)speed->total * INSTRUCTIONS_PER_TICK / speed->count),
         (unsigned long)(speed->most * INSTRUCTIONS_PER_TICK), room->stack);
}

int main(void) {
  cost control = {0, 0, 0, 0}, plant = {0, 0, 0, 0}, control_room = {0, 0, 0, 0}, plant_room = {0, 0, 0, 0};
  systick[1] = 0xFFFFFFu;
  systick[2] = 0;
  systick[0] = 5u; /* on, at the processor's clock, no interrupt */
  if (!tick_is_right()) {
    printf("a SysTick tick is not %d instructions: run qemu with -icount shift=0\n", INSTRUCTIONS_PER_TICK);
    return 1;
  }
  if (loop(&control, &plant, 0) != SPRINGLINE_OK || loop(&control_room, &plant_room, 1) != SPRINGLINE_OK) return 1;
  print("control step", &control, &control_room);
  print("plant step", &plant, &plant_room);
  return 0;
}
