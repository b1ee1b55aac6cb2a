/*
 * math_dense.c - the largest error of one function of sl_math.h over many arguments, in units in the last place.
 *
 * The reference is the host's long double, which needs 64 bits at least: its error is 0.001 ulp of a double. FUNCTION is
 * the function, EXACT(x) the reference.
 */
#include <float.h>
#include <math.h>

#include "sl_math.h"

#if LDBL_MANT_DIG < 64
#error "the reference needs a long double of 64 bits"
#endif

/* Arguments whose bits are first + i stride; returns the largest error, and where it is. */
double worst(uint64_t first, uint64_t stride, int64_t count, double *where) {
  double most = -1.0;
  int64_t i;
  for (i = 0; i < count; i++) {
    const double x = sl_real(first + (uint64_t)i * stride), got = FUNCTION(x);
    const long double exact = EXACT((long double)x);
    const uint64_t exponent = sl_bits((double)exact) & SL_EXPONENT;
    const double ulp = sl_real(exponent > (UINT64_C(52) << 52) ? exponent - (UINT64_C(52) << 52) : 1);
    const double error = fabs((double)(((long double)got - exact) / ulp));
    if (!(error <= most)) {
      most = error;
      *where = x;
    }
  }
  return most;
}
