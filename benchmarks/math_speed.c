/*
 * math_speed.c - each elementary function on VALUES independent arguments, again and again: on lanes as a kernel calls
 * it, one, two or four vectors at a time, as scalar function, and from the C library.
 *
 * Nothing waits for anything but the instructions of the function itself: no kernel gets more out of it.
 */
#define SL_W WIDTH
#include "sl_lanes.h"

#include <math.h>
#include <stdint.h>

enum { VALUES = 16 * SL_W, VECTORS = 16 };

static double argument[VALUES], result[VALUES];
static sl_v vector[VECTORS], first[VECTORS], second[VECTORS];
static volatile double seen;

#define DO_NOT_INLINE __attribute__((noinline))
/* Tells the compiler that memory is read and written here, so that it repeats the work. */
#define REPEAT __asm__ volatile("" ::: "memory")

#define LOOP(name, unroll, call)                                    \
  static DO_NOT_INLINE void name(int64_t rounds) {                  \
    sl_m ok = slv_yes();                                            \
    for (; rounds > 0; rounds--) {                                  \
      int i, j;                                                     \
      for (i = 0; i < VECTORS; i += unroll) {                       \
        _Pragma("GCC unroll 4") for (j = i; j < i + unroll; j++) {  \
          const sl_v x = vector[j];                                 \
          call;                                                     \
        }                                                           \
      }                                                             \
      REPEAT;                                                       \
    }                                                               \
    seen = slv_all(ok);                                             \
  }
#define SCALAR(name, call)                              \
  static DO_NOT_INLINE void name(int64_t rounds) {      \
    for (; rounds > 0; rounds--) {                      \
      int i;                                            \
      for (i = 0; i < VALUES; i++) {                    \
        const double x = argument[i];                   \
        call;                                           \
      }                                                 \
      REPEAT;                                           \
    }                                                   \
  }
#define FUNCTION(name, lanes, scalar, library) \
  LOOP(name##_1, 1, lanes)                     \
  LOOP(name##_2, 2, lanes)                     \
  LOOP(name##_4, 4, lanes)                     \
  SCALAR(name##_scalar, scalar)                \
  SCALAR(name##_library, library)
#define SIMPLE(name, library) \
  FUNCTION(name, first[j] = slv_##name##_fast(x, &ok), result[i] = sl_##name(x), result[i] = library)

SIMPLE(exp, exp(x))
SIMPLE(expm1, expm1(x))
SIMPLE(log, log(x))
SIMPLE(log1p, log1p(x))
SIMPLE(sin, sin(x))
SIMPLE(cos, cos(x))
SIMPLE(tan, tan(x))
SIMPLE(pow_m1_3, pow(x, -1.0 / 3.0))
SIMPLE(pow_p2_3, pow(x, 2.0 / 3.0))
SIMPLE(pow_p1_2, sqrt(x))
FUNCTION(pow, first[j] = slv_pow_fast(x, slv_set(0.7), &ok), result[i] = sl_pow(x, 0.7), result[i] = pow(x, 0.7))
FUNCTION(sincos, slv_sincos_fast(x, &first[j], &second[j], &ok), double c; sl_sincos(x, &result[i], &c); seen = c,
         result[i] = sin(x) + cos(x))

#define ROW(name) \
  { #name, { name##_1, name##_2, name##_4, name##_scalar, name##_library } }
static const struct {
  const char *name;
  void (*way[5])(int64_t);
} table[] = {ROW(exp), ROW(expm1), ROW(log), ROW(log1p), ROW(sin), ROW(cos), ROW(tan), ROW(sincos),
             ROW(pow), ROW(pow_m1_3), ROW(pow_p2_3), ROW(pow_p1_2)};

/* Name of function i, or 0 behind the last. */
const char *function_name(int i) { return i < (int)(sizeof table / sizeof *table) ? table[i].name : 0; }

/* `rounds` times VALUES values of function i; way 0, 1, 2: lanes, 1, 2 or 4 vectors at a time; 3 scalar; 4 library. */
void evaluate(int i, int way, int64_t rounds) {
  int k;
  for (k = 0; k < VALUES; k++) {
    argument[k] = 0.25 + 2.5 * k / VALUES;
    vector[k / SL_W] = slv_put(vector[k / SL_W], k % SL_W, argument[k]);
  }
  table[i].way[way](rounds);
}

int values(void) { return VALUES; }
