/*
 * float_accuracy.c - the largest error of one function of sl_mathf.h, in units in the last place of a float.
 *
 * The reference is the function of the same name on doubles, in lanes: its own error, below 2 ulp of a double, is
 * 4e-9 ulp of a float. NAME is the function, SYMMETRY 1 for an even one, -1 for an odd one, 0 else. With TURNS, large
 * arguments are reduced by 128 bits of 1 / (2 pi) for each power of 2, which sl_math.h does otherwise and slowly.
 * usual.h is sl_mathf.h with usual_ for slf_; in place of what calls a rare function it sets seen_rare. So the compiler
 * can make vectors of it; a block in which it was set is done again.
 */
#define SL_W 4
#include "sl_lanes.h"
#include "sl_mathf.h"

static int seen_rare;
#include "usual.h"

#define JOINED(a, b) a##b
#define CALL(prefix, name) JOINED(prefix, name)

enum { BLOCK = 1024 };

/* One over the last place of a float so large. */
static inline double per_ulp(double exact) {
  const double size = sl_fmax(sl_fabs(exact), 0x1p-126);
  return sl_real((UINT64_C(2069) << 52) - (sl_bits(size) & SL_EXPONENT));
}

/* Zeros count by their sign, infinity as the float behind the largest. */
static double error_of(float got, double exact) {
  if (got != got || exact != exact) return (got != got && exact != exact) ? 0.0 : SL_INF;
  if ((slf_bits(got) >> 31) != (sl_bits(exact) >> 63)) return SL_INF;
  {
    const double size = got - got != 0.0f ? 0x1p128 : sl_fabs(got), wanted = sl_fmin(sl_fabs(exact), 0x1p128);
    return sl_fabs(size - wanted) * per_ulp(sl_fmin(wanted, 0x1.fffffep127));
  }
}

#ifndef PAIRS
/* The worst of a block: its place, -1 if none is worse than `most`. No branch where all is well. */
static int worst_of(const float *got, const double *exact, int count, double *most) {
  uint64_t wrong = 0;
  int i, place = -1;
  for (i = 0; i < count; i++) {
    const double g = got[i], e = exact[i], rounded = (float)e;
    const uint64_t fine = -(uint64_t)(sl_fabs(g - e) * per_ulp(e) <= *most);
    const uint64_t infinite = -(uint64_t)(g == rounded) & -(uint64_t)(g - g != 0.0);
    const uint64_t none = -(uint64_t)(g != g) & -(uint64_t)(e != e);
    wrong |= ~(((fine | infinite) & ~(uint64_t)((int64_t)(sl_bits(g) ^ sl_bits(e)) >> 63)) | none);
  }
  if (wrong == 0) return -1;
  for (i = 0; i < count; i++) {
    const double error = error_of(got[i], exact[i]);
    if (error > *most) {
      *most = error;
      place = i;
    }
  }
  return place;
}

#ifdef TURNS
static const uint64_t turns[][2] = {TURNS}; /* 2^e / (2 pi) modulo 1, of the exponent field FIRST_TURNS on */

/* r of x = n pi/2 + r in place of x, and n. */
static void reduce(uint32_t bits, double *x, uint64_t *n) {
  const uint64_t m = (bits & SLF_FRACTION) | (SLF_FRACTION + 1), *turn = turns[(bits >> 23) - FIRST_TURNS];
  const unsigned __int128 low = (unsigned __int128)m * turn[1];
  const uint64_t high = m * turn[0] + (uint64_t)(low >> 64);
  *n = (high + (UINT64_C(1) << 61)) >> 62;
  *x = ((double)(int64_t)(high - (*n << 62)) * 0x1p64 + (double)(uint64_t)low) * (0x1.921fb54442d18p2 * 0x1p-128);
}

static void in_quarters(uint32_t first, double *x, double *r) {
  static double sine[BLOCK], cosine[BLOCK];
  static uint64_t n[BLOCK];
  int i;
  for (i = 0; i < BLOCK; i++) reduce(first + (uint32_t)i, &x[i], &n[i]);
  for (i = 0; i < BLOCK; i += SL_W) {
    sl_v s, c;
    slv_sincos(slv_load(x + i), &s, &c);
    slv_store(sine + i, s);
    slv_store(cosine + i, c);
  }
  for (i = 0; i < BLOCK; i++) {
    const double s = (n[i] & 1) != 0 ? cosine[i] : sine[i], c = (n[i] & 1) != 0 ? -sine[i] : cosine[i];
    const double sign = (n[i] & 2) != 0 ? -1.0 : 1.0;
    r[i] = QUARTERS;
    (void)s, (void)c, (void)sign;
  }
}
#endif

static void reference(uint32_t first, double *x, double *r) {
  int i;
#ifdef TURNS
  if ((first >> 23) >= FIRST_TURNS && (first >> 23) < 255) {
    in_quarters(first, x, r);
    return;
  }
#endif
  (void)first;
  for (i = 0; i < BLOCK; i += SL_W) slv_store(r + i, CALL(slv_, REFERENCE)(slv_load(x + i)));
}

static void evaluate(const float *x, float *r) {
  int i;
  seen_rare = 0;
  for (i = 0; i < BLOCK; i++) r[i] = CALL(usual_, NAME)(x[i]);
  if (seen_rare == 0) return;
  for (i = 0; i < BLOCK; i++) r[i] = CALL(slf_, NAME)(x[i]);
}

/* Over `count` positive floats from the bits `first` on, and the negative ones. */
double worst(uint32_t first, uint32_t count, float *where);
double worst(uint32_t first, uint32_t count, float *where) {
  static float x[BLOCK], got[BLOCK], back[BLOCK];
  static double wide[BLOCK], exact[BLOCK], behind[BLOCK];
  double most = -1.0;
  uint32_t done;
  int i, place;
  for (done = 0; done < count; done += BLOCK) {
    for (i = 0; i < BLOCK; i++) x[i] = slf_real(first + done + (uint32_t)i);
    for (i = 0; i < BLOCK; i++) wide[i] = x[i];
    evaluate(x, got);
    for (i = 0; i < BLOCK; i++) x[i] = -x[i];
    evaluate(x, back);
    reference(first + done, wide, exact);
    if ((place = worst_of(got, exact, BLOCK, &most)) >= 0) *where = -x[place];
    if (SYMMETRY != 0) {
      for (i = 0; i < BLOCK; i++) behind[i] = SYMMETRY * exact[i];
    } else {
      for (i = 0; i < BLOCK; i++) wide[i] = -wide[i];
      reference((first + done) | SLF_SIGN_BIT, wide, behind);
    }
    if ((place = worst_of(back, behind, BLOCK, &most)) >= 0) *where = x[place];
  }
  return most;
}
#else
/* Over pairs; `where` is the place of the worst. */
double worst(const float *x, const float *y, uint32_t count, uint32_t *where);
double worst(const float *x, const float *y, uint32_t count, uint32_t *where) {
  double most = -1.0;
  uint32_t i;
  for (i = 0; i < count; i++) {
    const double error = error_of(CALL(slf_, NAME)(x[i], y[i]), CALL(sl_, REFERENCE)(x[i], y[i]));
    if (error > most) {
      most = error;
      *where = i;
    }
  }
  return most;
}
#endif
