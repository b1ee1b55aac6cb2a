/*
 * float_accuracy.c - the largest error of one function of sl_mathf.h, in units in the last place of a float.
 *
 * The reference is the function of the same name on doubles, in lanes: its own error, below 2 ulp of a double, is
 * 4e-9 ulp of a float. FUNCTION is its name; SYMMETRY is 1 for an even function, -1 for an odd one, 0 else.
 */
#define SL_W 4
#include "sl_lanes.h"
#include "sl_mathf.h"

#define JOINED(a, b) a##b
#define CALL(prefix, name) JOINED(prefix, name)
#ifndef REFERENCE
#define REFERENCE FUNCTION
#endif

enum { BLOCK = 1024 };

/* Zeros count by their sign, and what overflows must be infinite. */
static double error_of(float got, double exact) {
  const uint64_t exponent = (sl_bits(exact) & SL_EXPONENT) >> 52;
  const double per_ulp = sl_real((2069 - (exponent < 897 ? 897 : exponent)) << 52);
  if (got != got || exact != exact) return (got != got && exact != exact) ? 0.0 : SL_INF;
  if (got - got != 0.0f || sl_fabs(exact) >= 0x1.ffffffp127) return got == (float)exact ? 0.0 : SL_INF;
  if ((slf_bits(got) >> 31) != (sl_bits(exact) >> 63)) return SL_INF;
  return sl_fabs((double)got - exact) * per_ulp;
}

static void compare(float x, float got, double exact, double *worst, float *where) {
  const double error = error_of(got, exact);
  if (error > *worst) {
    *worst = error;
    *where = x;
  }
}

#ifndef PAIRS
/* Over `count` positive floats from the bits `first` on, and the negative ones. */
double worst(uint32_t first, uint32_t count, float *where);
double worst(uint32_t first, uint32_t count, float *where) {
  static float x[BLOCK], there[BLOCK], back[BLOCK];
  static double wide[BLOCK], exact[BLOCK], exact_back[BLOCK];
  double most = -1.0;
  uint32_t done;
  int i;
  for (done = 0; done < count; done += BLOCK) {
    for (i = 0; i < BLOCK; i++) x[i] = slf_real(first + done + (uint32_t)i);
    for (i = 0; i < BLOCK; i++) wide[i] = x[i];
    for (i = 0; i < BLOCK; i++) there[i] = CALL(slf_, FUNCTION)(x[i]);
    for (i = 0; i < BLOCK; i++) back[i] = CALL(slf_, FUNCTION)(-x[i]);
    for (i = 0; i < BLOCK; i += SL_W) slv_store(exact + i, CALL(slv_, REFERENCE)(slv_load(wide + i)));
    if (SYMMETRY != 0) {
      for (i = 0; i < BLOCK; i++) exact_back[i] = SYMMETRY * exact[i];
    } else {
      for (i = 0; i < BLOCK; i += SL_W) slv_store(exact_back + i, CALL(slv_, REFERENCE)(-slv_load(wide + i)));
    }
    for (i = 0; i < BLOCK; i++) compare(x[i], there[i], exact[i], &most, where);
    for (i = 0; i < BLOCK; i++) compare(-x[i], back[i], exact_back[i], &most, where);
  }
  return most;
}
#else
/* Over pairs; `where` is the index of the worst. */
double worst(const float *x, const float *y, int count, int *where);
double worst(const float *x, const float *y, int count, int *where) {
  double most = -1.0;
  int i;
  for (i = 0; i < count; i++) {
    const double error = error_of(CALL(slf_, FUNCTION)(x[i], y[i]), CALL(sl_, REFERENCE)(x[i], y[i]));
    if (error > most) {
      most = error;
      *where = i;
    }
  }
  return most;
}
#endif
