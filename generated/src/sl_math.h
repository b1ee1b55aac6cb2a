/*
 * sl_math.h - elementary functions that give the same bits everywhere.
 *
 * Every result is a function of the argument bits alone: the kernels use IEEE double +, -, *, /,
 * sqrt, comparisons and integer operations, nothing else.  No libm call, no lookup table, no state,
 * no FMA. Any C99 compiler, optimisation level and instruction set agrees to the last bit, provided
 * that the compiler does not contract a*b+c (pass -ffp-contract=off) and evaluates double as
 * double.
 *
 * Errors are below 2 ulp over the whole double range (docs/math.md has the measured table); special
 * values are those of C99 Annex F.  Not reproducible: the sign and payload of a NaN.  Not
 * supported: flush-to-zero.
 *
 * How to read this file.  Part 1 are the scalar primitives.  Part 2 are the kernels, written once
 * in terms of SL_F (real), SL_B (its bits), SL_M (mask) and SL_FN(name).  Here they become
 * sl_name() on double; sl_lanes.h includes part 2 again and makes slv_name() on vectors of W
 * doubles.  A kernel computes the common case without branches; SL_PATCH then replaces the lanes
 * outside it by a scalar sl_name_rare().
 */
#ifndef SL_MATH_H
#define SL_MATH_H

#include <float.h>
#include <stdint.h>

#ifdef __FAST_MATH__
#error "sl_math.h needs IEEE arithmetic: compile without -ffast-math"
#endif
#if FLT_RADIX != 2 || DBL_MANT_DIG != 53 || DBL_MIN_EXP != -1021 || DBL_MAX_EXP != 1024
#error "sl_math.h needs 64-bit IEEE doubles: avr-gcc -mdouble=64, or export with --real float"
#endif
#ifndef UINT64_MAX
#error "sl_math.h needs uint64_t, which this compiler does not have: export with --real float"
#endif
#if defined(__FLOAT_WORD_ORDER__) && defined(__BYTE_ORDER__) && \
    __FLOAT_WORD_ORDER__ != __BYTE_ORDER__
#error "sl_math.h needs doubles in the byte order of integers: on ARM VFP or AAPCS, not FPA"
#endif
/* 2: long double, negative: unknown; with 1 and with the values from 16 on double arithmetic is
 * double */
#if defined(FLT_EVAL_METHOD) && \
    (FLT_EVAL_METHOD < 0 || FLT_EVAL_METHOD == 2 || FLT_EVAL_METHOD > 64)
#error "sl_math.h needs doubles evaluated as double: on x86 compile with -msse2 -mfpmath=sse"
#endif
typedef char sl_double_has_the_size_of_uint64_t[sizeof(double) == sizeof(uint64_t) ? 1 : -1];
#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

#if defined(__GNUC__)
#define SL_LIKELY(c) __builtin_expect((c) != 0, 1)
#define SL_COLD __attribute__((noinline, cold))
#define SL_RARE static __attribute__((noinline, cold, unused))
#else
#define SL_LIKELY(c) (c)
#define SL_COLD
#define SL_RARE static
#endif

/* ---- Part 1: scalar primitives --------------------------------------------------------------- */

#define SL_INF (sl_real(UINT64_C(0x7ff0000000000000)))
#define SL_NAN (sl_real(UINT64_C(0x7ff8000000000000)))
#define SL_SIGN_BIT UINT64_C(0x8000000000000000)
#define SL_EXPONENT UINT64_C(0x7ff0000000000000)
#define SL_FRACTION UINT64_C(0x000fffffffffffff)
#define SL_ONE UINT64_C(0x3ff0000000000000)     /* the bits of 1.0 */
/* leaves 26 significant bits: two such have an exact product */
#define SL_HIGH_26 UINT64_C(0xfffffffff8000000)
/* x + SL_ROUND holds x, rounded to an integer, in its low bits */
#define SL_ROUND 0x1.8p52
#define SL_LN2_HI 0x1.62e42fefa38p-1            /* 42 bits: times an exponent it is exact */
#define SL_LN2_LO 0x1.ef35793c7673p-45
#define SL_FIELD_BIAS 4503599627372544.0        /* 2^52 + 2048 */

typedef union {
  double real;
  uint64_t bits;
} sl_pun;

static inline uint64_t sl_bits(double x) {
  sl_pun u;
  u.real = x;
  return u.bits;
}

static inline double sl_real(uint64_t b) {
  sl_pun u;
  u.bits = b;
  return u.real;
}

static inline double sl_set(double x) { return x; }
static inline double sl_select(int m, double a, double b) { return m ? a : b; }
static inline double sl_if(int m, double a) { return m ? a : 0.0; }
static inline double sl_true(int m) { return m ? 1.0 : 0.0; }
static inline int sl_not(int m) { return !m; }
static inline int sl_any(int m) { return m != 0; }
static inline int sl_all(int m) { return m != 0; }
/* b if the top bit of `at` is set, else a */
static inline double sl_pick(uint64_t at, double a, double b) { return (at >> 63) != 0 ? b : a; }
/* a < limit, unsigned */
static inline int sl_below(uint64_t a, uint64_t limit) { return a < limit; }
static inline double sl_fmin(double a, double b) { return (a < b) ? a : b; }
static inline double sl_fmax(double a, double b) { return (a > b) ? a : b; }

/* The correctly rounded root in integers, digit by digit, for targets without a square-root
 * instruction. */
static inline double sl_sqrt_soft(double x) {
  uint64_t m = sl_bits(x), root = 0, twice = 0, digit;
  int e;
  if (!(x > 0.0)) return (x == 0.0) ? x : SL_NAN;
  if (m >= SL_EXPONENT) return x;
  e = (int)(m >> 52);
  if (e == 0) {
    for (; (m & (UINT64_C(1) << 52)) == 0; m <<= 1) e--;
    e++;
  }
  m = (m & ((UINT64_C(1) << 52) - 1)) | (UINT64_C(1) << 52);
  e -= 1023;
  if ((e & 1) != 0) {
    m <<= 1;
    e--;
  }
  m <<= 1;
  for (digit = UINT64_C(1) << 53; digit != 0; digit >>= 1) {
    uint64_t trial = twice + digit;
    if (trial <= m) {
      twice = trial + digit;
      m -= trial;
      root += digit;
    }
    m <<= 1;
  }
  if (m != 0) root += root & 1; /* never a tie: the root of a 53-bit number has no 54-bit end */
  return sl_real((root >> 1) + ((uint64_t)((e / 2) + 1022) << 52));
}

#if defined(SL_SOFT_SQRT)
static inline double sl_sqrt(double x) { return sl_sqrt_soft(x); }
#elif defined(__SSE2__)
#include <emmintrin.h>
static inline double sl_sqrt(double x) {
  __m128d v = _mm_set_sd(x);
  return _mm_cvtsd_f64(_mm_sqrt_sd(v, v));
}
#elif defined(__aarch64__) && defined(__GNUC__)
static inline double sl_sqrt(double x) {
  double r;
  __asm__("fsqrt %d0, %d1" : "=w"(r) : "w"(x));
  return r;
}
#elif defined(__arm__) && defined(__ARM_FP) && (__ARM_FP & 8) && defined(__GNUC__)
static inline double sl_sqrt(double x) {
  double r;
  __asm__("vsqrt.f64 %P0, %P1" : "=w"(r) : "w"(x));
  return r;
}
#elif defined(__riscv_flen) && __riscv_flen >= 64 && defined(__GNUC__)
static inline double sl_sqrt(double x) {
  double r;
  __asm__("fsqrt.d %0, %1" : "=f"(r) : "f"(x));
  return r;
}
#elif defined(__wasm__) && defined(__GNUC__)
static inline double sl_sqrt(double x) { return __builtin_sqrt(x); }
#else
static inline double sl_sqrt(double x) { return sl_sqrt_soft(x); }
#endif

/* p 2^k for p in [1/2, 2): one rounding, also where the result is denormal. */
static inline double sl_scale(double p, int k) {
  int half = k / 2;
  return p * sl_real((uint64_t)(half + 1023) << 52) * sl_real((uint64_t)((k - half) + 1023) << 52);
}

static inline int sl_isfinite(double x) { return (sl_bits(x) & SL_EXPONENT) != SL_EXPONENT; }

#define SL_F double
#define SL_B uint64_t
#define SL_M int
#define SL_FN(name) sl_##name
/* a kernel with rare lanes; sl_lanes.h makes a second kind of those */
#define SL_CHECKED(name) sl_##name
#define SL_OK
#define SL_PASS_OK
#define SL_SCALAR
#define SL_CORES
#define SL_POW_INLINE static inline
#define SL_DEFINE_PATCH1(name)
#define SL_DEFINE_PATCH2(name)
/* r = name(x) in the lanes where ok is false */
#define SL_PATCH1(ok, r, name, x)           \
  do {                                      \
    if (!SL_LIKELY(ok)) (r) = sl_##name(x); \
  } while (0)
#define SL_PATCH2(ok, r, name, x, y)           \
  do {                                         \
    if (!SL_LIKELY(ok)) (r) = sl_##name(x, y); \
  } while (0)
#endif /* SL_MATH_H */

/* ---- Part 2: kernels, once per SL_FN --------------------------------------------------------- */
#ifdef SL_FN

#ifdef SL_CORES
static inline SL_F SL_FN(sq)(SL_F x) {
  return x * x;
}

static inline SL_F SL_FN(fabs)(SL_F x) {
  return SL_FN(real)(SL_FN(bits)(x) & ~SL_SIGN_BIT);
}

static inline SL_F SL_FN(copysign)(SL_F x, SL_F sign) {
  return SL_FN(real)((SL_FN(bits)(x) & ~SL_SIGN_BIT) | (SL_FN(bits)(sign) & SL_SIGN_BIT));
}

/* -1, 1, or x itself where x is a zero or NaN. */
static inline SL_F SL_FN(sign)(SL_F x) {
  return SL_FN(select)(x > 0.0, SL_FN(set)(1.0), SL_FN(select)(x < 0.0, SL_FN(set)(-1.0), x));
}

/* x + 2^52 - 2^52 rounds |x| < 2^52 to the nearest integer; one comparison mends the direction. */
static inline SL_F SL_FN(floor)(SL_F x) {
  const SL_B sign = SL_FN(bits)(x) & SL_SIGN_BIT;
  const SL_F shift = SL_FN(real)((SL_FN(bits)(SL_FN(set)(0x1p+52)) & ~SL_SIGN_BIT) | sign);
  const SL_F nearest = (x + shift) - shift;
  const SL_F n = nearest - SL_FN(if)(x < nearest, SL_FN(set)(1.0));
  return SL_FN(select)(SL_FN(fabs)(x) < 0x1p+52,
      SL_FN(real)((SL_FN(bits)(n) & ~SL_SIGN_BIT) | sign), x);
}

static inline SL_F SL_FN(ceil)(SL_F x) {
  const SL_B sign = SL_FN(bits)(x) & SL_SIGN_BIT;
  const SL_F shift = SL_FN(real)((SL_FN(bits)(SL_FN(set)(0x1p+52)) & ~SL_SIGN_BIT) | sign);
  const SL_F nearest = (x + shift) - shift;
  const SL_F n = nearest + SL_FN(if)(nearest < x, SL_FN(set)(1.0));
  return SL_FN(select)(SL_FN(fabs)(x) < 0x1p+52,
      SL_FN(real)((SL_FN(bits)(n) & ~SL_SIGN_BIT) | sign), x);
}

#ifdef SL_SCALAR
SL_RARE double sl_hypot_rare(double x, double y) {
  double a = sl_fabs(x), b = sl_fabs(y), s;
  if ((a == SL_INF) || (b == SL_INF)) return SL_INF;
  if ((a != a) || (b != b)) return a + b;
  s = (sl_fmax(a, b) > 1.0) ? 0x1p600 : 0x1p-600;
  a /= s;
  b /= s;
  return sl_sqrt((a * a) + (b * b)) * s;
}
#endif
SL_DEFINE_PATCH2(hypot_rare)
#endif

static inline SL_F SL_CHECKED(hypot)(SL_F x, SL_F y SL_OK) {
  const SL_F q = (x * x) + (y * y);
  SL_F result = SL_FN(sqrt)(q);
  SL_PATCH2((q > 0x1p-900) & (q < 0x1p+1000), result, hypot_rare, x, y);
  return result;
}

/* ---- exp, expm1 ---------------------------------------------------------------------------------
 * x = k ln 2 + r, |r| <= ln 2 / 2, exp(r) = 1 + r + r^2 P(r) with P minimax of degree 9.  exp takes
 * r as one number; expm1 keeps the exact part of r apart and adds it last. */
#ifdef SL_CORES
#ifdef SL_SCALAR
/* exp(hi + lo) = significand 2^exponent */
static inline void SL_FN(exp_parts)(SL_F hi, SL_F lo, SL_F *significand, SL_F *exponent) {
  const SL_F t = (hi * 0x1.71547652b82fep+0) + SL_ROUND;
  const SL_F k = t - SL_ROUND;
  const SL_F r = (hi - (k * SL_LN2_HI)) - ((k * SL_LN2_LO) - lo);
  const SL_F r2 = r * r;
  const SL_F r4 = r2 * r2;
  const SL_F p03 = (0x1.000000000000ap-1 + (r * 0x1.55555555554fap-3)) +
      (r2 * (0x1.555555555088ap-5 + (r * 0x1.1111111127b48p-7)));
  const SL_F p47 = (0x1.6c16c184267b1p-10 + (r * 0x1.a01a012a833a8p-13)) +
      (r2 * (0x1.a0199a177a37fp-16 + (r * 0x1.71df2506b09b6p-19)));
  const SL_F p89 = 0x1.28ad67a46807dp-22 + (r * 0x1.ad7fc465e629dp-26);
  *significand = 1.0 + (r + (r2 * (p03 + (r4 * (p47 + (r4 * p89))))));
  *exponent = k;
}

/* 2^shift exp(hi + lo) for every hi but NaN: overflow, denormal results. */
static inline double sl_exp_sum_rare(double hi, double lo, int shift) {
  double m, k;
  if (hi > 711.0) return SL_INF;
  if (hi < -746.0) return 0.0;
  sl_exp_parts(hi, lo, &m, &k);
  return sl_scale(m, (int)k + shift);
}

SL_RARE double sl_exp_rare(double x) { return (x != x) ? x : sl_exp_sum_rare(x, 0.0, 0); }
SL_RARE double sl_expm1_rare(double x) {
  return (x != x) ? x : ((x < 0.0) ? -1.0 : sl_exp_sum_rare(x, 0.0, 0));
}
SL_RARE double sl_cosh_rare(double x) {
  return (x != x) ? x : sl_exp_sum_rare(sl_fabs(x), 0.0, -1);
}
SL_RARE double sl_sinh_rare(double x) { return sl_copysign(sl_cosh_rare(x), x); }
#endif
SL_DEFINE_PATCH1(exp_rare)
SL_DEFINE_PATCH1(expm1_rare)
SL_DEFINE_PATCH1(cosh_rare)
SL_DEFINE_PATCH1(sinh_rare)
#endif

static inline SL_F SL_CHECKED(exp)(SL_F x SL_OK) {
  const SL_F t = (x * 0x1.71547652b82fep+1) + SL_ROUND;
  const SL_F n = t - SL_ROUND;
  const SL_F r = (x - (n * 0x1.62e42fefa38p-2)) - (n * 0x1.ef35793c7673p-46);
  const SL_F r2 = r * r;
  const SL_F r4 = r2 * r2;
  const SL_F p03 = (0x1.ffffffffffefcp-2 + (r * 0x1.555555555589dp-3)) +
      (r2 * (0x1.555555560016p-5 + (r * 0x1.1111110f0d41ep-7)));
  const SL_F p47 = (0x1.6c16b8dcec34bp-10 + (r * 0x1.a01a1826fbb53p-13)) +
      (r2 * (0x1.a06fe78c68969p-16 + (r * 0x1.71a9f807860fep-19)));
  const SL_F root = SL_FN(pick)(SL_FN(bits)(t) << 63, SL_FN(set)(1.0),
      SL_FN(set)(0x1.ea09e667f3bcdp-1));
  const SL_F s = SL_FN(real)(SL_FN(bits)(root) + (SL_FN(bits)(t) << 51));
  SL_F result = s + (s * (r + (r2 * (p03 + (r4 * p47)))));
  SL_PATCH1(SL_FN(fabs)(x) < 708.0, result, exp_rare, x);
  return result;
}

static inline SL_F SL_CHECKED(expm1)(SL_F x SL_OK) {
  const SL_F t = (x * 0x1.71547652b82fep+0) + SL_ROUND;
  const SL_F k = t - SL_ROUND;
  const SL_F rh = x - (k * SL_LN2_HI);
  const SL_F rl = k * SL_LN2_LO;
  const SL_F s = SL_FN(real)((SL_FN(bits)(t) << 52) + SL_ONE);
  const SL_F large = (s * rh) - (1.0 - s);
  const SL_F r = rh - rl;
  const SL_F r2 = r * r;
  const SL_F r4 = r2 * r2;
  const SL_F p03 = (0x1.000000000000ap-1 + (r * 0x1.55555555554fap-3)) +
      (r2 * (0x1.555555555088ap-5 + (r * 0x1.1111111127b48p-7)));
  const SL_F p47 = (0x1.6c16c184267b1p-10 + (r * 0x1.a01a012a833a8p-13)) +
      (r2 * (0x1.a0199a177a37fp-16 + (r * 0x1.71df2506b09b6p-19)));
  const SL_F p89 = 0x1.28ad67a46807dp-22 + (r * 0x1.ad7fc465e629dp-26);
  const SL_F small = s * (rl - (r2 * (p03 + (r4 * (p47 + (r4 * p89))))));
  SL_F result = large - small;
  SL_PATCH1(SL_FN(fabs)(x) < 708.0, result, expm1_rare, x);
  return result;
}

static inline SL_F SL_CHECKED(cosh)(SL_F x SL_OK) {
  const SL_F a = SL_FN(fabs)(x);
  const SL_F t = (a * 0x1.71547652b82fep+0) + SL_ROUND;
  const SL_F k = t - SL_ROUND;
  const SL_F r = (a - (k * SL_LN2_HI)) - (k * SL_LN2_LO);
  const SL_F r2 = r * r;
  const SL_F r4 = r2 * r2;
  const SL_F p03 = (0x1.000000000000ap-1 + (r * 0x1.55555555554fap-3)) +
      (r2 * (0x1.555555555088ap-5 + (r * 0x1.1111111127b48p-7)));
  const SL_F p47 = (0x1.6c16c184267b1p-10 + (r * 0x1.a01a012a833a8p-13)) +
      (r2 * (0x1.a0199a177a37fp-16 + (r * 0x1.71df2506b09b6p-19)));
  const SL_F p89 = 0x1.28ad67a46807dp-22 + (r * 0x1.ad7fc465e629dp-26);
  const SL_F m = 1.0 + (r + (r2 * (p03 + (r4 * (p47 + (r4 * p89))))));
  const SL_F e = SL_FN(real)(SL_FN(bits)(m) + (SL_FN(bits)(t) << 52));
  SL_F result = (0.5 * e) + (0.5 / e);
  SL_PATCH1(a < 708.0, result, cosh_rare, x);
  return result;
}

/* (e + e / (1 + e)) / 2 with e + lo = exp|x| - 1; what the roundings of e and 1 + e left over
 * enters to first order. */
static inline SL_F SL_CHECKED(sinh)(SL_F x SL_OK) {
  const SL_F a = SL_FN(fabs)(x);
  const SL_F t = (a * 0x1.71547652b82fep+0) + SL_ROUND;
  const SL_F k = t - SL_ROUND;
  const SL_F rh = a - (k * SL_LN2_HI);
  const SL_F rl = k * SL_LN2_LO;
  const SL_F s = SL_FN(real)((SL_FN(bits)(t) << 52) + SL_ONE);
  const SL_F large = (s * rh) - (1.0 - s);
  const SL_F r = rh - rl;
  const SL_F r2 = r * r;
  const SL_F r4 = r2 * r2;
  const SL_F p03 = (0x1.000000000000ap-1 + (r * 0x1.55555555554fap-3)) +
      (r2 * (0x1.555555555088ap-5 + (r * 0x1.1111111127b48p-7)));
  const SL_F p47 = (0x1.6c16c184267b1p-10 + (r * 0x1.a01a012a833a8p-13)) +
      (r2 * (0x1.a0199a177a37fp-16 + (r * 0x1.71df2506b09b6p-19)));
  const SL_F p89 = 0x1.28ad67a46807dp-22 + (r * 0x1.ad7fc465e629dp-26);
  const SL_F small = s * (rl - (r2 * (p03 + (r4 * (p47 + (r4 * p89))))));
  const SL_F e = large - small;
  const SL_F lo = (large - e) - small;
  const SL_F u = 1.0 + e;
  const SL_F q = e / u;
  const SL_F v = 1.0 - q;
  const SL_F rest = (lo * (1.0 + (v * v))) - ((q * v) * (e - (u - 1.0)));
  const SL_F size = 0.5 * (e + (q + rest));
  SL_F result = SL_FN(copysign)(size, x);
  SL_PATCH1(a < 708.0, result, sinh_rare, x);
  return result;
}

#ifdef SL_CORES
/* With e + lo = exp(2|x|) - 1: e / (2 + e), mended likewise, which is 1 - 2 / (2 + e); 1 to the
 * last bit from 30 on. */
static inline SL_F SL_FN(tanh)(SL_F x) {
  const SL_F a = SL_FN(fabs)(x);
  const SL_F twice = 2.0 * SL_FN(fmin)(SL_FN(set)(30.0), a);
  const SL_F t = (twice * 0x1.71547652b82fep+0) + SL_ROUND;
  const SL_F k = t - SL_ROUND;
  const SL_F rh = twice - (k * SL_LN2_HI);
  const SL_F rl = k * SL_LN2_LO;
  const SL_F s = SL_FN(real)((SL_FN(bits)(t) << 52) + SL_ONE);
  const SL_F large = (s * rh) - (1.0 - s);
  const SL_F r = rh - rl;
  const SL_F r2 = r * r;
  const SL_F r4 = r2 * r2;
  const SL_F p03 = (0x1.000000000000ap-1 + (r * 0x1.55555555554fap-3)) +
      (r2 * (0x1.555555555088ap-5 + (r * 0x1.1111111127b48p-7)));
  const SL_F p47 = (0x1.6c16c184267b1p-10 + (r * 0x1.a01a012a833a8p-13)) +
      (r2 * (0x1.a0199a177a37fp-16 + (r * 0x1.71df2506b09b6p-19)));
  const SL_F p89 = 0x1.28ad67a46807dp-22 + (r * 0x1.ad7fc465e629dp-26);
  const SL_F small = s * (rl - (r2 * (p03 + (r4 * (p47 + (r4 * p89))))));
  const SL_F e = large - small;
  const SL_F lo = (large - e) - small;
  const SL_F u = 2.0 + e;
  const SL_M is_small = a < 0.55;
  const SL_F q = SL_FN(select)(is_small, e, SL_FN(set)(2.0)) / u;
  const SL_F other = 1.0 - q;
  const SL_F v = 0.5 * other;
  const SL_F rest = v * (((2.0 * v) * lo) - (q * (e - (u - 2.0))));
  const SL_F size = SL_FN(select)(is_small, q + rest, other);
  return SL_FN(copysign)(size, x);
}

#endif

/* ---- log, log1p ---------------------------------------------------------------------------------
 * x = 2^k m with m in [sqrt(1/2), sqrt(2)), f = m - 1, s = f / (2 + f), log m = 2 atanh s
 * = f - s (f - s^2 P(s^2)) with P minimax of degree 6. */
#ifdef SL_CORES
#ifdef SL_SCALAR
/* log(2^-54 x) */
static inline SL_F SL_FN(log_denormal)(SL_F x) {
  const SL_B b = SL_FN(bits)(x);
  const SL_B shifted = b - UINT64_C(0x3fe6a09e667f3bcd);
  const SL_F minus_k = 0x1.0000000000836p+52 -
      SL_FN(real)((shifted >> 52) ^ UINT64_C(0x4330000000000800));
  const SL_F f = SL_FN(real)(b - (shifted & ~SL_FRACTION)) - 1.0;
  const SL_F s = f / (2.0 + f);
  const SL_F z = s * s;
  const SL_F w = z * z;
  const SL_F p46 = (0x1.74663bf8e45adp-3 + (z * 0x1.39a2023bc6593p-3)) + (w * 0x1.2f02b927c3e23p-3);
  const SL_F p = (0x1.5555555555592p-1 + (z * 0x1.999999997ff4cp-2)) +
      (w * ((0x1.24924941dcee9p-2 + (z * 0x1.c71c52189af7dp-3)) + (w * p46)));
  return (f - ((s * (f - (z * p))) + (minus_k * SL_LN2_LO))) + (minus_k * -SL_LN2_HI);
}

SL_RARE double sl_log_rare(double x) {
  if ((x != x) || (x == SL_INF)) return x;
  if (x == 0.0) return -SL_INF;
  return (x < 0.0) ? SL_NAN : sl_log_denormal(x * 0x1p54);
}
#endif
SL_DEFINE_PATCH1(log_rare)
#endif

static inline SL_F SL_CHECKED(log)(SL_F x SL_OK) {
  const SL_B b = SL_FN(bits)(x);
  const SL_B shifted = b - UINT64_C(0x3fe6a09e667f3bcd);
  const SL_F minus_k = SL_FIELD_BIAS - SL_FN(real)((shifted >> 52) ^ UINT64_C(0x4330000000000800));
  const SL_F f = SL_FN(real)(b - (shifted & ~SL_FRACTION)) - 1.0;
  const SL_F s = f / (2.0 + f);
  const SL_F z = s * s;
  const SL_F w = z * z;
  const SL_F p46 = (0x1.74663bf8e45adp-3 + (z * 0x1.39a2023bc6593p-3)) + (w * 0x1.2f02b927c3e23p-3);
  const SL_F p = (0x1.5555555555592p-1 + (z * 0x1.999999997ff4cp-2)) +
      (w * ((0x1.24924941dcee9p-2 + (z * 0x1.c71c52189af7dp-3)) + (w * p46)));
  SL_F result = (f - ((s * (f - (z * p))) + (minus_k * SL_LN2_LO))) + (minus_k * -SL_LN2_HI);
  SL_PATCH1(SL_FN(below)(shifted + UINT64_C(0x3fd6a09e667f3bcd), UINT64_C(0x7fe0000000000000)),
      result, log_rare, x);
  return result;
}

#ifdef SL_CORES
#ifdef SL_SCALAR
/* x <= -1, NaN, or so large (2^1000) that 1 is nothing to it */
SL_RARE double sl_log1p_rare(double x) {
  return (x > 1.0) ? sl_log(x) : sl_log_rare(1.0 + x);
}
#endif
SL_DEFINE_PATCH1(log1p_rare)
#endif

/* 1 + x rounded gives k alone.  m lies in [3/4, 3/2): there f = x 2^-k - (1 - 2^-k) is exact.  Of
 * two zeros the result has the sign of f, which is x's. */
static inline SL_F SL_CHECKED(log1p)(SL_F x SL_OK) {
  const SL_B shifted = SL_FN(bits)(1.0 + x) - UINT64_C(0x3fe8000000000000);
  const SL_F minus_k = SL_FIELD_BIAS - SL_FN(real)((shifted >> 52) ^ UINT64_C(0x4330000000000800));
  const SL_F scale = SL_FN(real)(SL_ONE - (shifted & ~SL_FRACTION));
  const SL_F f = (x * scale) - (1.0 - scale);
  const SL_F s = f / (2.0 + f);
  const SL_F z = s * s;
  const SL_F w = z * z;
  const SL_F p46 = (0x1.7474da65bd729p-3 + (z * 0x1.38536f6f973ffp-3)) + (w * 0x1.3ab9e70597862p-3);
  const SL_F p = (0x1.5555555555773p-1 + (z * 0x1.99999998f1641p-2)) +
      (w * ((0x1.249249b1be681p-2 + (z * 0x1.c71c019db48a8p-3)) + (w * p46)));
  SL_F result = (f - ((s * (f - (z * p))) + (minus_k * SL_LN2_LO))) + (minus_k * -SL_LN2_HI);
  SL_PATCH1(SL_FN(below)(shifted + UINT64_C(0x0358000000000000), UINT64_C(0x41f0000000000000)),
      result, log1p_rare, x);
  return result;
}

/* ---- sin, cos, tan ------------------------------------------------------------------------------
 * x = n pi/2 + r - rest, |r| <= pi/4.  pi/2 has two 36-bit pieces and a double: n times a piece is
 * exact, and rest, n times the third, is added last.  Both polynomials are evaluated, swapped and
 * signed by n.  tan r = r + r^3 T(r^2); in odd quarters -1 / tan r, divided with the remainder
 * carried along. */
#ifdef SL_CORES
#ifdef SL_SCALAR
static inline void sl_mul64(uint64_t a, uint64_t b, uint64_t *hi, uint64_t *lo) {
  uint64_t a0 = a & 0xffffffffu, a1 = a >> 32, b0 = b & 0xffffffffu, b1 = b >> 32;
  uint64_t low = a0 * b0, mid = (a1 * b0) + (low >> 32), mid2 = (a0 * b1) + (mid & 0xffffffffu);
  *hi = ((a1 * b1) + (mid >> 32)) + (mid2 >> 32);
  *lo = (mid2 << 32) | (low & 0xffffffffu);
}

/* Payne and Hanek, for |x| >= 2^17: x 2/pi modulo 4 in integers, from the 192 bits of 2/pi that
 * matter for it. Returns n (modulo 4) and r; r is NaN for an infinite or NaN x. */
SL_RARE uint64_t sl_reduce_rare(double x, double *hi, double *lo) {
  static const uint64_t two_over_pi[20] = {
      UINT64_C(0),                  UINT64_C(0xa2f9836e4e441529), UINT64_C(0xfc2757d1f534ddc0),
      UINT64_C(0xdb6295993c439041), UINT64_C(0xfe5163abdebbc561), UINT64_C(0xb7246e3a424dd2e0),
      UINT64_C(0x06492eea09d1921c), UINT64_C(0xfe1deb1cb129a73e), UINT64_C(0xe88235f52ebb4484),
      UINT64_C(0xe99c7026b45f7e41), UINT64_C(0x3991d639835339f4), UINT64_C(0x9c845f8bbdf9283b),
      UINT64_C(0x1ff897ffde05980f), UINT64_C(0xef2f118b5a0a6d1f), UINT64_C(0x6d367ecf27cb09b7),
      UINT64_C(0x4f463f669e5fea2d), UINT64_C(0x7527bac7ebe5f17b), UINT64_C(0x3d0739f78a5292ea),
      UINT64_C(0x6bfb5fb11f8d5d08), UINT64_C(0x56033046fc7b6bab)};
  uint64_t b = sl_bits(x), m = (b & SL_FRACTION) | (UINT64_C(1) << 52);
  uint64_t t[3], p0, p1, p2, h, l, n, sign = b & SL_SIGN_BIT;
  int e = (int)((b & SL_EXPONENT) >> 52), first = e - 1013, i, shift;
  double unit;
  if (e == 2047) {
    *hi = SL_NAN;
    *lo = SL_NAN;
    return 0;
  }
  for (i = 0; i < 3; i++) { /* the bits before `first` weigh whole turns */
    int word = (first / 64) + i, bit = first % 64;
    t[i] = (bit == 0) ? two_over_pi[word]
                      : (two_over_pi[word] << bit) | (two_over_pi[word + 1] >> (64 - bit));
  }
  sl_mul64(m, t[2], &h, &p2); /* p = m t modulo 2^192; 2^190 is a quarter turn */
  sl_mul64(m, t[1], &n, &l);
  p1 = l + h;
  p0 = ((m * t[0]) + n) + (p1 < l);
  n = p0 >> 62;
  p0 = (p0 << 2) | (p1 >> 62);
  p1 = (p1 << 2) | (p2 >> 62);
  if ((p0 >> 63) != 0) { /* past the middle of the quarter: the next one, less the rest */
    n++;
    p0 = ~p0;
    p1 = ~p1;
    sign ^= SL_SIGN_BIT;
  }
  for (shift = 0; ((p0 >> 63) == 0) && (shift < 63); shift++) {
    p0 = (p0 << 1) | (p1 >> 63);
    p1 <<= 1;
  }
  sl_mul64(p0, UINT64_C(0xc90fdaa22168c235), &h, &l); /* times pi/2, in units of 2^-63 */
  unit = sl_real((uint64_t)(1023 - 63 - shift) << 52);
  *hi = sl_copysign((double)(h >> 11) * 0x1p11 * unit, sl_real(sign));
  *lo = sl_copysign((double)(h & 0x7ff) * unit, sl_real(sign));
  return (b & SL_SIGN_BIT) != 0 ? 0 - n : n;
}

/* of r + lo, in the quarter that the low bits of t tell */
static inline void SL_FN(sincos_reduced)(SL_F r, SL_F lo, SL_F t, SL_F *sine, SL_F *cosine) {
  const SL_F z = r * r;
  const SL_F w = z * z;
  const SL_F v = z * r;
  const SL_F ps = (-0x1.5555555555548p-3 + (z * 0x1.111111110f733p-7)) +
      (w * ((-0x1.a01a019bea64dp-13 + (z * 0x1.71de35574d307p-19)) +
      (w * (-0x1.ae5e4e231f75fp-26 + (z * 0x1.5d8c63e45a9a4p-33)))));
  const SL_F pc = (0x1.555555555554bp-5 + (z * -0x1.6c16c16c15015p-10)) +
      (w * ((0x1.a01a019c8f24bp-16 + (z * -0x1.27e4f7f190216p-22)) +
      (w * (0x1.1ee9dbcdae5f2p-29 + (z * -0x1.8fa683a3ac44p-37)))));
  const SL_F s = r - ((-lo) - (v * ps));
  const SL_F c = 1.0 - ((0.5 * z) - (w * pc));
  const SL_B odd = SL_FN(bits)(t) << 63;
  const SL_B upper = SL_FN(bits)(t) << 62;
  *sine = SL_FN(real)(SL_FN(bits)(SL_FN(pick)(odd, s, c)) ^ (upper & SL_SIGN_BIT));
  *cosine = SL_FN(real)(SL_FN(bits)(SL_FN(pick)(odd, c, s)) ^ ((upper ^ odd) & SL_SIGN_BIT));
}

static inline SL_F SL_FN(tan_reduced)(SL_F r, SL_F lo, SL_F t) {
  const SL_F z = r * r;
  const SL_F w = z * z;
  const SL_F w2 = w * w;
  const SL_F p03 = (0x1.55555555554f2p-2 + (z * 0x1.11111111182c9p-3)) +
      (w * (0x1.ba1ba1b46be95p-5 + (z * 0x1.664f49a85a48p-6)));
  const SL_F p47 = (0x1.226e125c18b3fp-7 + (z * 0x1.d6d933881d934p-9)) +
      (w * (0x1.7d5b5e6ff45aap-10 + (z * 0x1.37fa7e070f8a4p-11)));
  const SL_F p8b = (0x1.d2714bfc9fed7p-13 + (z * 0x1.1e282527e334bp-13)) +
      (w * (-0x1.b8eede5990f4ep-16 + (z * 0x1.76cae235549b2p-14)));
  const SL_F pcd = -0x1.7806da6d76e2ap-15 + (z * 0x1.5dd31c74861afp-16);
  const SL_F p = p03 + (w2 * (p47 + (w2 * (p8b + (w2 * pcd)))));
  const SL_F u = (r * z) * p;
  const SL_F first = r + u;
  const SL_F v = u - ((-lo) * (1.0 + (first * first)));
  const SL_F tangent = r + v;
  const SL_F lo2 = v - (tangent - r);
  const SL_F q = -1.0 / tangent;
  const SL_F inverse = q + ((q * q) * lo2);
  return SL_FN(pick)(SL_FN(bits)(t) << 63, tangent, inverse);
}

SL_RARE double sl_sin_rare(double x) {
  double hi, lo, sine, cosine;
  const uint64_t n = sl_reduce_rare(x, &hi, &lo);
  sl_sincos_reduced(hi, lo, sl_real(n & 3), &sine, &cosine);
  return sine;
}
SL_RARE double sl_cos_rare(double x) {
  double hi, lo, sine, cosine;
  const uint64_t n = sl_reduce_rare(x, &hi, &lo);
  sl_sincos_reduced(hi, lo, sl_real(n & 3), &sine, &cosine);
  return cosine;
}
SL_RARE double sl_tan_rare(double x) {
  double hi, lo;
  const uint64_t n = sl_reduce_rare(x, &hi, &lo);
  return sl_tan_reduced(hi, lo, sl_real(n & 3));
}
#endif
SL_DEFINE_PATCH1(sin_rare)
SL_DEFINE_PATCH1(cos_rare)
SL_DEFINE_PATCH1(tan_rare)
#endif

static inline void SL_CHECKED(sincos)(SL_F x, SL_F *sine, SL_F *cosine SL_OK) {
  const SL_F t = (x * 0x1.45f306dc9c883p-1) + SL_ROUND;
  const SL_F n = t - SL_ROUND;
  const SL_F a = x - (n * 0x1.921fb5444p+0);
  const SL_F b = n * 0x1.68c234c4cp-39;
  const SL_F r = a - b;
  const SL_F rest = n * 0x1.98a2e03707345p-77;
  const SL_F z = r * r;
  const SL_F w = z * z;
  const SL_F v = z * r;
  const SL_F ps = (-0x1.5555555555548p-3 + (z * 0x1.111111110f733p-7)) +
      (w * ((-0x1.a01a019bea64dp-13 + (z * 0x1.71de35574d307p-19)) +
      (w * (-0x1.ae5e4e231f75fp-26 + (z * 0x1.5d8c63e45a9a4p-33)))));
  const SL_F pc = (0x1.555555555554bp-5 + (z * -0x1.6c16c16c15015p-10)) +
      (w * ((0x1.a01a019c8f24bp-16 + (z * -0x1.27e4f7f190216p-22)) +
      (w * (0x1.1ee9dbcdae5f2p-29 + (z * -0x1.8fa683a3ac44p-37)))));
  const SL_F s = r - (rest - (v * ps));
  const SL_F c = 1.0 - ((0.5 * z) - (w * pc));
  const SL_B odd = SL_FN(bits)(t) << 63;
  const SL_B upper = SL_FN(bits)(t) << 62;
  *sine = SL_FN(real)(SL_FN(bits)(SL_FN(pick)(odd, s, c)) ^ (upper & SL_SIGN_BIT));
  *cosine = SL_FN(real)(SL_FN(bits)(SL_FN(pick)(odd, c, s)) ^ ((upper ^ odd) & SL_SIGN_BIT));
  SL_PATCH1(SL_FN(fabs)(x) < 131072.0, *sine, sin_rare, x);
  SL_PATCH1(SL_FN(fabs)(x) < 131072.0, *cosine, cos_rare, x);
}

static inline SL_F SL_CHECKED(sin)(SL_F x SL_OK) {
  const SL_F t = (x * 0x1.45f306dc9c883p-1) + SL_ROUND;
  const SL_F n = t - SL_ROUND;
  const SL_F a = x - (n * 0x1.921fb5444p+0);
  const SL_F b = n * 0x1.68c234c4cp-39;
  const SL_F r = a - b;
  const SL_F rest = n * 0x1.98a2e03707345p-77;
  const SL_F z = r * r;
  const SL_F w = z * z;
  const SL_F v = z * r;
  const SL_F ps = (-0x1.5555555555548p-3 + (z * 0x1.111111110f733p-7)) +
      (w * ((-0x1.a01a019bea64dp-13 + (z * 0x1.71de35574d307p-19)) +
      (w * (-0x1.ae5e4e231f75fp-26 + (z * 0x1.5d8c63e45a9a4p-33)))));
  const SL_F pc = (0x1.555555555554bp-5 + (z * -0x1.6c16c16c15015p-10)) +
      (w * ((0x1.a01a019c8f24bp-16 + (z * -0x1.27e4f7f190216p-22)) +
      (w * (0x1.1ee9dbcdae5f2p-29 + (z * -0x1.8fa683a3ac44p-37)))));
  const SL_F s = r - (rest - (v * ps));
  const SL_F c = 1.0 - ((0.5 * z) - (w * pc));
  const SL_B odd = SL_FN(bits)(t) << 63;
  const SL_B upper = SL_FN(bits)(t) << 62;
  SL_F result = SL_FN(real)(SL_FN(bits)(SL_FN(pick)(odd, s, c)) ^ (upper & SL_SIGN_BIT));
  SL_PATCH1(SL_FN(fabs)(x) < 131072.0, result, sin_rare, x);
  return result;
}

static inline SL_F SL_CHECKED(cos)(SL_F x SL_OK) {
  const SL_F t = (x * 0x1.45f306dc9c883p-1) + SL_ROUND;
  const SL_F n = t - SL_ROUND;
  const SL_F a = x - (n * 0x1.921fb5444p+0);
  const SL_F b = n * 0x1.68c234c4cp-39;
  const SL_F r = a - b;
  const SL_F rest = n * 0x1.98a2e03707345p-77;
  const SL_F z = r * r;
  const SL_F w = z * z;
  const SL_F v = z * r;
  const SL_F ps = (-0x1.5555555555548p-3 + (z * 0x1.111111110f733p-7)) +
      (w * ((-0x1.a01a019bea64dp-13 + (z * 0x1.71de35574d307p-19)) +
      (w * (-0x1.ae5e4e231f75fp-26 + (z * 0x1.5d8c63e45a9a4p-33)))));
  const SL_F pc = (0x1.555555555554bp-5 + (z * -0x1.6c16c16c15015p-10)) +
      (w * ((0x1.a01a019c8f24bp-16 + (z * -0x1.27e4f7f190216p-22)) +
      (w * (0x1.1ee9dbcdae5f2p-29 + (z * -0x1.8fa683a3ac44p-37)))));
  const SL_F s = r - (rest - (v * ps));
  const SL_F c = 1.0 - ((0.5 * z) - (w * pc));
  const SL_B odd = SL_FN(bits)(t) << 63;
  const SL_B upper = SL_FN(bits)(t) << 62;
  SL_F result = SL_FN(real)(SL_FN(bits)(SL_FN(pick)(odd, c, s)) ^ ((upper ^ odd) & SL_SIGN_BIT));
  SL_PATCH1(SL_FN(fabs)(x) < 131072.0, result, cos_rare, x);
  return result;
}

static inline SL_F SL_CHECKED(tan)(SL_F x SL_OK) {
  const SL_F t = (x * 0x1.45f306dc9c883p-1) + SL_ROUND;
  const SL_F n = t - SL_ROUND;
  const SL_F a = x - (n * 0x1.921fb5444p+0);
  const SL_F b = n * 0x1.68c234c4cp-39;
  const SL_F r = a - b;
  const SL_F rest = (n * 0x1.98a2e03707345p-77) - ((a - r) - b);
  const SL_F z = r * r;
  const SL_F w = z * z;
  const SL_F w2 = w * w;
  const SL_F p03 = (0x1.55555555554f2p-2 + (z * 0x1.11111111182c9p-3)) +
      (w * (0x1.ba1ba1b46be95p-5 + (z * 0x1.664f49a85a48p-6)));
  const SL_F p47 = (0x1.226e125c18b3fp-7 + (z * 0x1.d6d933881d934p-9)) +
      (w * (0x1.7d5b5e6ff45aap-10 + (z * 0x1.37fa7e070f8a4p-11)));
  const SL_F p8b = (0x1.d2714bfc9fed7p-13 + (z * 0x1.1e282527e334bp-13)) +
      (w * (-0x1.b8eede5990f4ep-16 + (z * 0x1.76cae235549b2p-14)));
  const SL_F pcd = -0x1.7806da6d76e2ap-15 + (z * 0x1.5dd31c74861afp-16);
  const SL_F p = p03 + (w2 * (p47 + (w2 * (p8b + (w2 * pcd)))));
  const SL_F u = (r * z) * p;
  const SL_F first = r + u;
  const SL_F v = u - (rest * (1.0 + (first * first)));
  const SL_F tangent = r + v;
  const SL_F lo = v - (tangent - r);
  const SL_F q = -1.0 / tangent;
  const SL_F inverse = q + ((q * q) * lo);
  SL_F result = SL_FN(pick)(SL_FN(bits)(t) << 63, tangent, inverse);
  SL_PATCH1(SL_FN(fabs)(x) < 131072.0, result, tan_rare, x);
  return result;
}

/* ---- atan, atan2, asin, acos ----------------------------------------------------------------- */
#ifdef SL_CORES
/* The angle in [0, pi/2] whose tangent is y / x, both positive: atan c + atan t with c = 0, 1/2, 1,
 * 3/2 or infinite, c = b / a and t = (a y - b x) / (a x + b y), |t| <= 7/16. */
static inline SL_F SL_FN(atan)(SL_F x) {
  const SL_F y = SL_FN(fmin)(SL_FN(set)(0x1p+1000), SL_FN(fabs)(x));
  const SL_M m1 = y >= 0.4375;
  const SL_M m2 = y >= 0.6875;
  const SL_M m3 = y >= 1.1875;
  const SL_M m4 = y >= 2.4375;
  const SL_F first = SL_FN(true)(m1);
  const SL_F a = SL_FN(select)(m4, SL_FN(set)(0.0),
      SL_FN(select)(m2, SL_FN(set)(1.0), 1.0 + first));
  const SL_F b = SL_FN(select)(m4, SL_FN(set)(1.0), SL_FN(select)(m3, SL_FN(set)(1.5), first));
  const SL_F hi = SL_FN(select)(m4, SL_FN(set)(0x1.921fb54442d18p+0),
      SL_FN(select)(m3, SL_FN(set)(0x1.f730bd281f69bp-1),
      SL_FN(select)(m2, SL_FN(set)(0x1.921fb54442d18p-1),
      SL_FN(if)(m1, SL_FN(set)(0x1.dac670561bb4fp-2)))));
  const SL_F lo = SL_FN(select)(m4, SL_FN(set)(0x1.1a62633145c07p-54),
      SL_FN(select)(m3, SL_FN(set)(0x1.007887af0cbbdp-56),
      SL_FN(select)(m2, SL_FN(set)(0x1.1a62633145c07p-55),
      SL_FN(if)(m1, SL_FN(set)(0x1.a2b7f222f65e2p-56)))));
  const SL_F t = ((a * y) - b) / (a + (b * y));
  const SL_F z = t * t;
  const SL_F w = z * z;
  const SL_F w2 = w * w;
  const SL_F p03 = (-0x1.555555555550bp-2 + (z * 0x1.999999998e7ecp-3)) +
      (w * (-0x1.2492491ff36a1p-3 + (z * 0x1.c71c6fdb28516p-4)));
  const SL_F p47 = (-0x1.745cdba591548p-4 + (z * 0x1.3b0f2069ab996p-4)) +
      (w * (-0x1.10d601f28f5c9p-4 + (z * 0x1.ddddb11c0de1fp-5)));
  const SL_F p8a = (-0x1.97a08d886231cp-5 + (z * 0x1.2b17b5f0f8355p-5)) +
      (w * -0x1.0a7ea8ff09049p-6);
  const SL_F p = p03 + (w2 * (p47 + (w2 * p8a)));
  const SL_F angle = hi + (t + (lo + ((t * z) * p)));
  return SL_FN(copysign)(angle, x);
}

#ifdef SL_SCALAR
static inline SL_F SL_FN(angle)(SL_F y, SL_F x) {
  const SL_M m1 = (0.4375 * x) <= y;
  const SL_M m2 = (0.6875 * x) <= y;
  const SL_M m3 = (1.1875 * x) <= y;
  const SL_M m4 = (2.4375 * x) <= y;
  const SL_F first = SL_FN(true)(m1);
  const SL_F a = SL_FN(select)(m4, SL_FN(set)(0.0),
      SL_FN(select)(m2, SL_FN(set)(1.0), 1.0 + first));
  const SL_F b = SL_FN(select)(m4, SL_FN(set)(1.0), SL_FN(select)(m3, SL_FN(set)(1.5), first));
  const SL_F hi = SL_FN(select)(m4, SL_FN(set)(0x1.921fb54442d18p+0),
      SL_FN(select)(m3, SL_FN(set)(0x1.f730bd281f69bp-1),
      SL_FN(select)(m2, SL_FN(set)(0x1.921fb54442d18p-1),
      SL_FN(if)(m1, SL_FN(set)(0x1.dac670561bb4fp-2)))));
  const SL_F lo = SL_FN(select)(m4, SL_FN(set)(0x1.1a62633145c07p-54),
      SL_FN(select)(m3, SL_FN(set)(0x1.007887af0cbbdp-56),
      SL_FN(select)(m2, SL_FN(set)(0x1.1a62633145c07p-55),
      SL_FN(if)(m1, SL_FN(set)(0x1.a2b7f222f65e2p-56)))));
  const SL_F t = ((a * y) - (b * x)) / ((a * x) + (b * y));
  const SL_F z = t * t;
  const SL_F w = z * z;
  const SL_F w2 = w * w;
  const SL_F p03 = (-0x1.555555555550bp-2 + (z * 0x1.999999998e7ecp-3)) +
      (w * (-0x1.2492491ff36a1p-3 + (z * 0x1.c71c6fdb28516p-4)));
  const SL_F p47 = (-0x1.745cdba591548p-4 + (z * 0x1.3b0f2069ab996p-4)) +
      (w * (-0x1.10d601f28f5c9p-4 + (z * 0x1.ddddb11c0de1fp-5)));
  const SL_F p8a = (-0x1.97a08d886231cp-5 + (z * 0x1.2b17b5f0f8355p-5)) +
      (w * -0x1.0a7ea8ff09049p-6);
  const SL_F p = p03 + (w2 * (p47 + (w2 * p8a)));
  return hi + (t + (lo + ((t * z) * p)));
}

/* Infinities are compared by kind, zeros lie on an axis, everything else only needs another scale.
 */
SL_RARE double sl_atan2_rare(double y, double x) {
  double a = sl_fabs(y), b = sl_fabs(x), most = sl_fmax(a, b), r;
  double scale = (most > 0x1p1000) ? 0x1p-100 : ((most < 0x1p-900) ? 0x1p100 : 1.0);
  if ((x != x) || (y != y)) return x + y;
  if ((a == SL_INF) || (b == SL_INF)) {
    a = sl_true(a == SL_INF);
    b = sl_true(b == SL_INF);
    scale = 1.0;
  }
  if ((a != 0.0) && (b == 0.0)) return sl_copysign(0x1.921fb54442d18p+0, y);
  r = (a == 0.0) ? 0.0 : sl_angle(a * scale, b * scale);
  if ((sl_bits(x) & SL_SIGN_BIT) != 0) r = 0x1.921fb54442d18p+1 - (r - 0x1.1a62633145c07p-53);
  return sl_copysign(r, y);
}
#endif
SL_DEFINE_PATCH2(atan2_rare)

/* asin s = s + s^3 P(s^2) for s <= 1/2; from there on asin x = pi/2 - 2 asin s with
 * s = sqrt((1 - x) / 2) = sh + sl. */
static inline SL_F SL_FN(asin)(SL_F x) {
  const SL_F abs_x = SL_FN(fabs)(x);
  const SL_M is_small = abs_x < 0.5;
  const SL_F z = SL_FN(select)(is_small, abs_x * abs_x, 0.5 * (1.0 - abs_x));
  const SL_F s = SL_FN(sqrt)(z);
  const SL_F sh = SL_FN(real)(SL_FN(bits)(s) & SL_HIGH_26);
  const SL_F sl = (z - (sh * sh)) / SL_FN(fmax)(SL_FN(set)(0x1p-1022), s + sh);
  const SL_F w = z * z;
  const SL_F w2 = w * w;
  const SL_F p03 = (0x1.555555555539p-3 + (z * 0x1.333333336e854p-4)) +
      (w * (0x1.6db6db4276f73p-5 + (z * 0x1.f1c72c3a15e85p-6)));
  const SL_F p47 = (0x1.6e89f425ddbafp-6 + (z * 0x1.1c6be32b477a6p-6)) +
      (w * (0x1.c6fda43ff74edp-7 + (z * 0x1.8ec3b9e8fdf71p-7)));
  const SL_F p8b = (0x1.abc9194ea091fp-8 + (z * 0x1.3ff8dbdaf8618p-6)) +
      (w * (-0x1.09d99aa6f64c8p-6 + (z * 0x1.056f96435a3b3p-5)));
  const SL_F tail = z * (p03 + (w2 * (p47 + (w2 * p8b))));
  const SL_F p = ((2.0 * s) * tail) - (0x1.1a62633145c07p-54 - (2.0 * sl));
  const SL_F q = 0x1.921fb54442d18p-1 - (2.0 * sh);
  const SL_F large = 0x1.921fb54442d18p-1 - (p - q);
  const SL_F size = SL_FN(select)(is_small, abs_x + (abs_x * tail), large);
  return SL_FN(copysign)(size, x);
}

static inline SL_F SL_FN(acos)(SL_F x) {
  const SL_F abs_x = SL_FN(fabs)(x);
  const SL_M is_small = abs_x < 0.5;
  const SL_F z = SL_FN(select)(is_small, abs_x * abs_x, 0.5 * (1.0 - abs_x));
  const SL_F s = SL_FN(sqrt)(z);
  const SL_F sh = SL_FN(real)(SL_FN(bits)(s) & SL_HIGH_26);
  const SL_F sl = (z - (sh * sh)) / SL_FN(fmax)(SL_FN(set)(0x1p-1022), s + sh);
  const SL_F w = z * z;
  const SL_F w2 = w * w;
  const SL_F p03 = (0x1.555555555539p-3 + (z * 0x1.333333336e854p-4)) +
      (w * (0x1.6db6db4276f73p-5 + (z * 0x1.f1c72c3a15e85p-6)));
  const SL_F p47 = (0x1.6e89f425ddbafp-6 + (z * 0x1.1c6be32b477a6p-6)) +
      (w * (0x1.c6fda43ff74edp-7 + (z * 0x1.8ec3b9e8fdf71p-7)));
  const SL_F p8b = (0x1.abc9194ea091fp-8 + (z * 0x1.3ff8dbdaf8618p-6)) +
      (w * (-0x1.09d99aa6f64c8p-6 + (z * 0x1.056f96435a3b3p-5)));
  const SL_F tail = z * (p03 + (w2 * (p47 + (w2 * p8b))));
  const SL_F rest = s * tail;
  const SL_F half = SL_FN(select)(x < 0.0, 0x1.921fb54442d18p+0 -
      (s + (rest - 0x1.1a62633145c07p-54)), sh + (rest + sl));
  const SL_F middle = 0x1.921fb54442d18p+0 - (x - (0x1.1a62633145c07p-54 - (x * tail)));
  return SL_FN(select)(is_small, middle, half + half);
}

#endif

static inline SL_F SL_CHECKED(atan2)(SL_F y, SL_F x SL_OK) {
  const SL_F abs_y = SL_FN(fabs)(y);
  const SL_F abs_x = SL_FN(fabs)(x);
  const SL_M m1 = (0.4375 * abs_x) <= abs_y;
  const SL_M m2 = (0.6875 * abs_x) <= abs_y;
  const SL_M m3 = (1.1875 * abs_x) <= abs_y;
  const SL_M m4 = (2.4375 * abs_x) <= abs_y;
  const SL_F first = SL_FN(true)(m1);
  const SL_F a = SL_FN(select)(m4, SL_FN(set)(0.0),
      SL_FN(select)(m2, SL_FN(set)(1.0), 1.0 + first));
  const SL_F b = SL_FN(select)(m4, SL_FN(set)(1.0), SL_FN(select)(m3, SL_FN(set)(1.5), first));
  const SL_F hi = SL_FN(select)(m4, SL_FN(set)(0x1.921fb54442d18p+0),
      SL_FN(select)(m3, SL_FN(set)(0x1.f730bd281f69bp-1),
      SL_FN(select)(m2, SL_FN(set)(0x1.921fb54442d18p-1),
      SL_FN(if)(m1, SL_FN(set)(0x1.dac670561bb4fp-2)))));
  const SL_F lo = SL_FN(select)(m4, SL_FN(set)(0x1.1a62633145c07p-54),
      SL_FN(select)(m3, SL_FN(set)(0x1.007887af0cbbdp-56),
      SL_FN(select)(m2, SL_FN(set)(0x1.1a62633145c07p-55),
      SL_FN(if)(m1, SL_FN(set)(0x1.a2b7f222f65e2p-56)))));
  const SL_F t = ((a * abs_y) - (b * abs_x)) / ((a * abs_x) + (b * abs_y));
  const SL_F z = t * t;
  const SL_F w = z * z;
  const SL_F w2 = w * w;
  const SL_F p03 = (-0x1.555555555550bp-2 + (z * 0x1.999999998e7ecp-3)) +
      (w * (-0x1.2492491ff36a1p-3 + (z * 0x1.c71c6fdb28516p-4)));
  const SL_F p47 = (-0x1.745cdba591548p-4 + (z * 0x1.3b0f2069ab996p-4)) +
      (w * (-0x1.10d601f28f5c9p-4 + (z * 0x1.ddddb11c0de1fp-5)));
  const SL_F p8a = (-0x1.97a08d886231cp-5 + (z * 0x1.2b17b5f0f8355p-5)) +
      (w * -0x1.0a7ea8ff09049p-6);
  const SL_F p = p03 + (w2 * (p47 + (w2 * p8a)));
  const SL_F angle = hi + (t + (lo + ((t * z) * p)));
  const SL_F reflected = SL_FN(select)(x < 0.0, 0x1.921fb54442d18p+1 -
      (angle - 0x1.1a62633145c07p-53), angle);
  SL_F result = SL_FN(copysign)(reflected, y);
  SL_PATCH2(((abs_y > 0x1p-1000) & (abs_y < 0x1p+1000)) &
      ((abs_x > 0x1p-1000) & (abs_x < 0x1p+1000)), result, atan2_rare, y, x);
  return result;
}

/* ---- the cube-root family -----------------------------------------------------------------------
 * y0 ~ x^(-1/3) from the bits of x divided by -3 (in floating point: lanes have no 64-bit
 * division), times a cubic polynomial of u = x y0^3, in factors: y has an error of 1e-6.  With
 * h = 1 - x y^3
 * x^(-1/3) = y (1 - h)^(-1/3), and likewise x^(1/3) from x y^2, x^(2/3) from x y, x^(-2/3) from
 * y^2 (there h = 1 - x^2 y^6), each by one step of third order.  h sees the roundings of these
 * products. */
#ifdef SL_CORES
#ifdef SL_SCALAR
static inline SL_F SL_FN(p1_3_sum)(SL_F x) {
  const SL_F t = SL_FN(real)((SL_FN(bits)(x) >> 20) | UINT64_C(0x4330000000000000));
  const SL_F divided = 0x1.55aa9c70e38a5p+52 - (t * 0x1.5555555555555p-2);
  const SL_F y0 = SL_FN(real)(SL_FN(bits)(divided) << 20);
  const SL_F u = (x * y0) * (y0 * y0);
  const SL_F y = ((y0 * -0x1.435e87cb87d78p-8) * (u - 0x1.0ccf36b58beaep+3)) *
      ((u * (u - 0x1.04a1a00bc1e04p+2)) + 0x1.d3cf10e73aa3cp+4);
  const SL_F z = (x * y) * y;
  const SL_F h = 1.0 - (z * y);
  return z + ((z * h) * (0x1.555555555bcf7p-1 + (0x1.1c71c71c79b04p-1 * h)));
}

static inline SL_F SL_FN(m1_3_sum)(SL_F x) {
  const SL_F t = SL_FN(real)((SL_FN(bits)(x) >> 20) | UINT64_C(0x4330000000000000));
  const SL_F divided = 0x1.55aa9c70e38a5p+52 - (t * 0x1.5555555555555p-2);
  const SL_F y0 = SL_FN(real)(SL_FN(bits)(divided) << 20);
  const SL_F u = (x * y0) * (y0 * y0);
  const SL_F y = ((y0 * -0x1.435e87cb87d78p-8) * (u - 0x1.0ccf36b58beaep+3)) *
      ((u * (u - 0x1.04a1a00bc1e04p+2)) + 0x1.d3cf10e73aa3cp+4);
  const SL_F h = 1.0 - ((x * y) * (y * y));
  return y + ((y * h) * (0x1.555555556777fp-2 + (0x1.c71c71c744b7ap-3 * h)));
}

static inline SL_F SL_FN(p2_3_sum)(SL_F x) {
  const SL_F t = SL_FN(real)((SL_FN(bits)(x) >> 20) | UINT64_C(0x4330000000000000));
  const SL_F divided = 0x1.55aa9c70e38a5p+52 - (t * 0x1.5555555555555p-2);
  const SL_F y0 = SL_FN(real)(SL_FN(bits)(divided) << 20);
  const SL_F u = (x * y0) * (y0 * y0);
  const SL_F y = ((y0 * -0x1.435e87cb87d78p-8) * (u - 0x1.0ccf36b58beaep+3)) *
      ((u * (u - 0x1.04a1a00bc1e04p+2)) + 0x1.d3cf10e73aa3cp+4);
  const SL_F z = x * y;
  const SL_F h = 1.0 - (z * (y * y));
  return z + ((z * h) * (0x1.555555556777fp-2 + (0x1.c71c71c744b7ap-3 * h)));
}

static inline SL_F SL_FN(m2_3_sum)(SL_F x) {
  const SL_F t = SL_FN(real)((SL_FN(bits)(x) >> 20) | UINT64_C(0x4330000000000000));
  const SL_F divided = 0x1.55aa9c70e38a5p+52 - (t * 0x1.5555555555555p-2);
  const SL_F y0 = SL_FN(real)(SL_FN(bits)(divided) << 20);
  const SL_F u = (x * y0) * (y0 * y0);
  const SL_F y = ((y0 * -0x1.435e87cb87d78p-8) * (u - 0x1.0ccf36b58beaep+3)) *
      ((u * (u - 0x1.04a1a00bc1e04p+2)) + 0x1.d3cf10e73aa3cp+4);
  const SL_F z = y * y;
  const SL_F v = x * z;
  const SL_F h = 1.0 - ((v * z) * v);
  return z + ((z * h) * (0x1.555555556777fp-2 + (0x1.c71c71c744b7ap-3 * h)));
}

/* x^(thirds/3) of what the fast path leaves out: zeros, infinities, NaN, negative, very small and
 * very large x. */
SL_RARE double sl_thirds_rare(double x, int thirds) {
  double scale, back; /* (scale x)^(1/3) back = x^(1/3) */
  if (x != x) return x;
  if ((x == 0.0) || (sl_fabs(x) == SL_INF)) {
    return ((x == 0.0) == (thirds > 0)) ? 0.0 : SL_INF;
  }
  if (x < 0.0) return SL_NAN;
  scale = (x < 1.0) ? 0x1p600 : 0x1p-600;
  back = (x < 1.0) ? 0x1p-200 : 0x1p200;
  switch (thirds) {
    case 1: return sl_p1_3_sum(x * scale) * back;
    case 2: return sl_p2_3_sum(x * scale) * (back * back);
    case -1: return sl_m1_3_sum(x * scale) / back;
    default: return sl_m2_3_sum(x * scale) / (back * back);
  }
}
SL_RARE double sl_p1_3_rare(double x) { return sl_thirds_rare(x, 1); }
SL_RARE double sl_p2_3_rare(double x) { return sl_thirds_rare(x, 2); }
SL_RARE double sl_m1_3_rare(double x) { return sl_thirds_rare(x, -1); }
SL_RARE double sl_m2_3_rare(double x) { return sl_thirds_rare(x, -2); }
SL_RARE double sl_cbrt_rare(double x) { return sl_copysign(sl_thirds_rare(sl_fabs(x), 1), x); }
#endif
SL_DEFINE_PATCH1(p1_3_rare)
SL_DEFINE_PATCH1(p2_3_rare)
SL_DEFINE_PATCH1(m1_3_rare)
SL_DEFINE_PATCH1(m2_3_rare)
SL_DEFINE_PATCH1(cbrt_rare)
#endif

static inline SL_F SL_CHECKED(pow_p1_3)(SL_F x SL_OK) {
  const SL_F t = SL_FN(real)((SL_FN(bits)(x) >> 20) | UINT64_C(0x4330000000000000));
  const SL_F divided = 0x1.55aa9c70e38a5p+52 - (t * 0x1.5555555555555p-2);
  const SL_F y0 = SL_FN(real)(SL_FN(bits)(divided) << 20);
  const SL_F u = (x * y0) * (y0 * y0);
  const SL_F y = ((y0 * -0x1.435e87cb87d78p-8) * (u - 0x1.0ccf36b58beaep+3)) *
      ((u * (u - 0x1.04a1a00bc1e04p+2)) + 0x1.d3cf10e73aa3cp+4);
  const SL_F z = (x * y) * y;
  const SL_F h = 1.0 - (z * y);
  SL_F result = z + ((z * h) * (0x1.555555555bcf7p-1 + (0x1.1c71c71c79b04p-1 * h)));
  SL_PATCH1(SL_FN(below)(SL_FN(bits)(x) - UINT64_C(0x0170000000000000),
      UINT64_C(0x7d00000000000000)), result, p1_3_rare, x);
  return result;
}

static inline SL_F SL_CHECKED(pow_p2_3)(SL_F x SL_OK) {
  const SL_F t = SL_FN(real)((SL_FN(bits)(x) >> 20) | UINT64_C(0x4330000000000000));
  const SL_F divided = 0x1.55aa9c70e38a5p+52 - (t * 0x1.5555555555555p-2);
  const SL_F y0 = SL_FN(real)(SL_FN(bits)(divided) << 20);
  const SL_F u = (x * y0) * (y0 * y0);
  const SL_F y = ((y0 * -0x1.435e87cb87d78p-8) * (u - 0x1.0ccf36b58beaep+3)) *
      ((u * (u - 0x1.04a1a00bc1e04p+2)) + 0x1.d3cf10e73aa3cp+4);
  const SL_F z = x * y;
  const SL_F h = 1.0 - (z * (y * y));
  SL_F result = z + ((z * h) * (0x1.555555556777fp-2 + (0x1.c71c71c744b7ap-3 * h)));
  SL_PATCH1(SL_FN(below)(SL_FN(bits)(x) - UINT64_C(0x0170000000000000),
      UINT64_C(0x7d00000000000000)), result, p2_3_rare, x);
  return result;
}

static inline SL_F SL_CHECKED(pow_m1_3)(SL_F x SL_OK) {
  const SL_F t = SL_FN(real)((SL_FN(bits)(x) >> 20) | UINT64_C(0x4330000000000000));
  const SL_F divided = 0x1.55aa9c70e38a5p+52 - (t * 0x1.5555555555555p-2);
  const SL_F y0 = SL_FN(real)(SL_FN(bits)(divided) << 20);
  const SL_F u = (x * y0) * (y0 * y0);
  const SL_F y = ((y0 * -0x1.435e87cb87d78p-8) * (u - 0x1.0ccf36b58beaep+3)) *
      ((u * (u - 0x1.04a1a00bc1e04p+2)) + 0x1.d3cf10e73aa3cp+4);
  const SL_F h = 1.0 - ((x * y) * (y * y));
  SL_F result = y + ((y * h) * (0x1.555555556777fp-2 + (0x1.c71c71c744b7ap-3 * h)));
  SL_PATCH1(SL_FN(below)(SL_FN(bits)(x) - UINT64_C(0x0170000000000000),
      UINT64_C(0x7d00000000000000)), result, m1_3_rare, x);
  return result;
}

static inline SL_F SL_CHECKED(pow_m2_3)(SL_F x SL_OK) {
  const SL_F t = SL_FN(real)((SL_FN(bits)(x) >> 20) | UINT64_C(0x4330000000000000));
  const SL_F divided = 0x1.55aa9c70e38a5p+52 - (t * 0x1.5555555555555p-2);
  const SL_F y0 = SL_FN(real)(SL_FN(bits)(divided) << 20);
  const SL_F u = (x * y0) * (y0 * y0);
  const SL_F y = ((y0 * -0x1.435e87cb87d78p-8) * (u - 0x1.0ccf36b58beaep+3)) *
      ((u * (u - 0x1.04a1a00bc1e04p+2)) + 0x1.d3cf10e73aa3cp+4);
  const SL_F z = y * y;
  const SL_F v = x * z;
  const SL_F h = 1.0 - ((v * z) * v);
  SL_F result = z + ((z * h) * (0x1.555555556777fp-2 + (0x1.c71c71c744b7ap-3 * h)));
  SL_PATCH1(SL_FN(below)(SL_FN(bits)(x) - UINT64_C(0x0170000000000000),
      UINT64_C(0x7d00000000000000)), result, m2_3_rare, x);
  return result;
}

static inline SL_F SL_CHECKED(cbrt)(SL_F x SL_OK) {
  const SL_F a = SL_FN(fabs)(x);
  const SL_F t = SL_FN(real)((SL_FN(bits)(a) >> 20) | UINT64_C(0x4330000000000000));
  const SL_F divided = 0x1.55aa9c70e38a5p+52 - (t * 0x1.5555555555555p-2);
  const SL_F y0 = SL_FN(real)(SL_FN(bits)(divided) << 20);
  const SL_F u = (a * y0) * (y0 * y0);
  const SL_F y = ((y0 * -0x1.435e87cb87d78p-8) * (u - 0x1.0ccf36b58beaep+3)) *
      ((u * (u - 0x1.04a1a00bc1e04p+2)) + 0x1.d3cf10e73aa3cp+4);
  const SL_F z = (a * y) * y;
  const SL_F h = 1.0 - (z * y);
  const SL_F root = z + ((z * h) * (0x1.555555555bcf7p-1 + (0x1.1c71c71c79b04p-1 * h)));
  SL_F result = SL_FN(copysign)(root, x);
  SL_PATCH1(SL_FN(below)(SL_FN(bits)(a) - UINT64_C(0x0170000000000000),
      UINT64_C(0x7d00000000000000)), result, cbrt_rare, x);
  return result;
}

/* ---- pow ----------------------------------------------------------------------------------------
 * First the other exponents with a kernel of their own. */
#ifdef SL_CORES
static inline SL_F SL_FN(pow_p1)(SL_F x) {
  return x;
}

static inline SL_F SL_FN(pow_m1)(SL_F x) {
  return 1.0 / x;
}

static inline SL_F SL_FN(pow_p2)(SL_F x) {
  return x * x;
}

static inline SL_F SL_FN(pow_p3)(SL_F x) {
  return (x * x) * x;
}

#ifdef SL_SCALAR /* unlike sqrt, pow(-inf, 1/2) = +inf */
SL_RARE double sl_half_rare(double x) { return -x; }
SL_RARE double sl_minus_half_rare(double x) { return -1.0 / x; }
#endif
SL_DEFINE_PATCH1(half_rare)
SL_DEFINE_PATCH1(minus_half_rare)
#endif

static inline SL_F SL_CHECKED(pow_p1_2)(SL_F x SL_OK) {
  SL_F result = SL_FN(sqrt)(x) + 0.0;
  SL_PATCH1(x != -SL_INF, result, half_rare, x);
  return result;
}

static inline SL_F SL_CHECKED(pow_m1_2)(SL_F x SL_OK) {
  SL_F result = 1.0 / (SL_FN(sqrt)(x) + 0.0);
  SL_PATCH1(x != -SL_INF, result, minus_half_rare, x);
  return result;
}

static inline SL_F SL_CHECKED(pow_p3_2)(SL_F x SL_OK) {
  SL_F result = x * SL_FN(sqrt)(x);
  SL_PATCH1(x != -SL_INF, result, half_rare, x);
  return result;
}

#ifdef SL_CORES
#ifdef SL_SCALAR
/* hi + lo = y log x; the exponent of x counts from `bias` on. */
static inline void SL_FN(pow_log)(SL_F x, SL_F y, SL_F bias, SL_F *hi, SL_F *lo) {
  const SL_B shifted = SL_FN(bits)(x) - UINT64_C(0x3fed580000000000);
  const SL_F k = SL_FN(real)((shifted >> 52) ^ UINT64_C(0x4330000000000800)) - bias;
  const SL_F m = SL_FN(real)((shifted & SL_FRACTION) + UINT64_C(0x3fed580000000000));
  const SL_B first = shifted << 12;
  const SL_B second = shifted << 13;
  const SL_F c = SL_FN(pick)(first, SL_FN(pick)(second, SL_FN(set)(1.0),
      SL_FN(set)(0x1.2d26acp+0)), SL_FN(pick)(second, SL_FN(set)(0x1.72d4cp+0),
      SL_FN(set)(0x1.b372a8p+0)));
  const SL_F log_c = SL_FN(pick)(first, SL_FN(pick)(second, SL_FN(set)(0.0),
      SL_FN(set)(0x1.4caa7dcbe8acfp-3)),
      SL_FN(pick)(second, SL_FN(set)(0x1.7b7679c3bb462p-2), SL_FN(set)(0x1.0ff923a807833p-1)));
  const SL_F f = m - c;
  const SL_F u = m + c;
  const SL_F v = 1.0 / u;
  const SL_F s = f * v;
  const SL_F sh = SL_FN(real)(SL_FN(bits)(s) & SL_HIGH_26);
  const SL_F uh = SL_FN(real)(SL_FN(bits)(u) & SL_HIGH_26);
  const SL_F sl = ((f - (sh * uh)) - (sh * (m - (uh - c)))) * v;
  const SL_F ds = (sh - s) + sl;
  const SL_F z = s * s;
  const SL_F w = z * z;
  const SL_F p = (0x1.5555555555555p-1 + (z * 0x1.999999999a393p-2)) +
      (w * ((0x1.2492492181b18p-2 + (z * 0x1.c71c7f485bf65p-3)) +
      (w * (0x1.744eb860cb8a9p-3 + (z * 0x1.41fb23ae5a2d1p-3)))));
  const SL_F kl = k * SL_LN2_HI;
  const SL_F tk = kl + log_c;
  const SL_F tl = (kl - tk) + log_c;
  const SL_F sh2 = sh + sh;
  const SL_F h = tk + sh2;
  const SL_F rest = (tl + (k * SL_LN2_LO)) + ((sl + sl) + ((z + z) * ds));
  const SL_F low = (((tk - h) + sh2) + rest) + ((s * z) * p);
  const SL_F lh = SL_FN(real)(SL_FN(bits)(h + low) & SL_HIGH_26);
  const SL_F ll = (h - lh) + low;
  const SL_F yh = SL_FN(real)(SL_FN(bits)(y) & SL_HIGH_26);
  *hi = yh * lh;
  *lo = (y * ll) + ((y - yh) * lh);
}

/* 0: not an integer, 1: odd, 2: even */
static inline int sl_parity(double y) {
  double a = sl_fabs(y), h = 0.5 * a;
  if (a >= 0x1p53) return 2;
  if (sl_floor(a) != a) return 0;
  return (sl_floor(h) == h) ? 2 : 1;
}

/* C99 F.9.4.4, then the general case with every scaling. */
SL_RARE double sl_pow_rare(double x, double y) {
  double a = sl_fabs(x), hi, lo, bias = SL_FIELD_BIAS, r;
  int parity;
  if ((y == 0.0) || (x == 1.0)) return 1.0;
  if ((x != x) || (y != y)) return x + y;
  if (sl_fabs(y) == SL_INF) return (a == 1.0) ? 1.0 : (((a > 1.0) == (y > 0.0)) ? SL_INF : 0.0);
  parity = sl_parity(y);
  if ((a == 0.0) || (a == SL_INF)) {
    r = ((a == 0.0) == (y > 0.0)) ? 0.0 : SL_INF;
  } else {
    if ((x < 0.0) && (parity == 0)) return SL_NAN;
    if (a < DBL_MIN) {
      a *= 0x1p54;
      bias += 54.0;
    }
    sl_pow_log(a, y, bias, &hi, &lo);
    r = sl_exp_sum_rare(hi, lo, 0);
  }
  return (parity == 1) ? sl_copysign(r, x) : r;
}
#endif
SL_DEFINE_PATCH2(pow_rare)
#endif

/* pow for exponents that are not listed below: hi + lo = y log x to about 2^-63 relative.
 * x = 2^k m; m / c is near 1 for one of four 26-bit numbers c whose logarithms are almost doubles;
 * s = (m - c) / (m + c) as sh + sl, log m = log c + 2 atanh s. */
static inline SL_F SL_CHECKED(pow_general)(SL_F x, SL_F y SL_OK) {
  const SL_B shifted = SL_FN(bits)(x) - UINT64_C(0x3fed580000000000);
  const SL_F k = SL_FN(real)((shifted >> 52) ^ UINT64_C(0x4330000000000800)) - SL_FIELD_BIAS;
  const SL_F m = SL_FN(real)((shifted & SL_FRACTION) + UINT64_C(0x3fed580000000000));
  const SL_B first = shifted << 12;
  const SL_B second = shifted << 13;
  const SL_F c = SL_FN(pick)(first, SL_FN(pick)(second, SL_FN(set)(1.0),
      SL_FN(set)(0x1.2d26acp+0)), SL_FN(pick)(second, SL_FN(set)(0x1.72d4cp+0),
      SL_FN(set)(0x1.b372a8p+0)));
  const SL_F log_c = SL_FN(pick)(first, SL_FN(pick)(second, SL_FN(set)(0.0),
      SL_FN(set)(0x1.4caa7dcbe8acfp-3)),
      SL_FN(pick)(second, SL_FN(set)(0x1.7b7679c3bb462p-2), SL_FN(set)(0x1.0ff923a807833p-1)));
  const SL_F f = m - c;
  const SL_F u = m + c;
  const SL_F v = 1.0 / u;
  const SL_F s = f * v;
  const SL_F sh = SL_FN(real)(SL_FN(bits)(s) & SL_HIGH_26);
  const SL_F uh = SL_FN(real)(SL_FN(bits)(u) & SL_HIGH_26);
  const SL_F sl = ((f - (sh * uh)) - (sh * (m - (uh - c)))) * v;
  const SL_F ds = (sh - s) + sl;
  const SL_F z = s * s;
  const SL_F w = z * z;
  const SL_F p = (0x1.5555555555555p-1 + (z * 0x1.999999999a393p-2)) +
      (w * ((0x1.2492492181b18p-2 + (z * 0x1.c71c7f485bf65p-3)) +
      (w * (0x1.744eb860cb8a9p-3 + (z * 0x1.41fb23ae5a2d1p-3)))));
  const SL_F kl = k * SL_LN2_HI;
  const SL_F tk = kl + log_c;
  const SL_F tl = (kl - tk) + log_c;
  const SL_F sh2 = sh + sh;
  const SL_F h = tk + sh2;
  const SL_F rest = (tl + (k * SL_LN2_LO)) + ((sl + sl) + ((z + z) * ds));
  const SL_F low = (((tk - h) + sh2) + rest) + ((s * z) * p);
  const SL_F lh = SL_FN(real)(SL_FN(bits)(h + low) & SL_HIGH_26);
  const SL_F ll = (h - lh) + low;
  const SL_F yh = SL_FN(real)(SL_FN(bits)(y) & SL_HIGH_26);
  const SL_F hi = yh * lh;
  const SL_F lo = (y * ll) + ((y - yh) * lh);
  const SL_F t = (hi * 0x1.71547652b82fep+0) + SL_ROUND;
  const SL_F k2 = t - SL_ROUND;
  const SL_F r = (hi - (k2 * SL_LN2_HI)) - ((k2 * SL_LN2_LO) - lo);
  const SL_F r2 = r * r;
  const SL_F r4 = r2 * r2;
  const SL_F p03 = (0x1.000000000000ap-1 + (r * 0x1.55555555554fap-3)) +
      (r2 * (0x1.555555555088ap-5 + (r * 0x1.1111111127b48p-7)));
  const SL_F p47 = (0x1.6c16c184267b1p-10 + (r * 0x1.a01a012a833a8p-13)) +
      (r2 * (0x1.a0199a177a37fp-16 + (r * 0x1.71df2506b09b6p-19)));
  const SL_F p89 = 0x1.28ad67a46807dp-22 + (r * 0x1.ad7fc465e629dp-26);
  const SL_F m2 = 1.0 + (r + (r2 * (p03 + (r4 * (p47 + (r4 * p89))))));
  SL_F result = SL_FN(real)(SL_FN(bits)(m2) + (SL_FN(bits)(t) << 52));
  SL_PATCH2(SL_FN(below)(shifted + UINT64_C(0x3fdd580000000000), UINT64_C(0x7fe0000000000000)) &
      (SL_FN(fabs)(hi) < 708.0), result, pow_rare, x, y);
  return result;
}

/* The exponents y at which pow(x, y) is by definition the kernel pow_name(x); 1/3 and 2/3 are the
 * nearest doubles. Their fractions have nothing, or 0101...01, below the first bit: that is how
 * SL_POW_LISTED knows them. */
#define SL_POW_LIST(entry)           \
  entry(0x1.5555555555555p-2, p1_3)  \
  entry(-0x1.5555555555555p-2, m1_3) \
  entry(0x1.5555555555555p-1, p2_3)  \
  entry(-0x1.5555555555555p-1, m2_3) \
  entry(0.5, p1_2)                   \
  entry(-0.5, m1_2)                  \
  entry(1.5, p3_2)                   \
  entry(1.0, p1)                     \
  entry(-1.0, m1)                    \
  entry(2.0, p2)                     \
  entry(3.0, p3)
#define SL_POW_LISTED(low) (((low) == UINT64_C(0)) | ((low) == UINT64_C(0xaaaaaaaaaaaaa000)))

#ifdef SL_CORES
#define SL_POW_ALL(value, name) if (SL_FN(all)(y == (value))) return SL_FN(pow_##name)(x);
#define SL_POW_ANY(value, name) \
  if (SL_FN(any)(y == (value))) r = SL_FN(select)(y == (value), SL_FN(pow_##name)(x), r);
/* pow where at least one lane may have a listed exponent: one branch if all have the same, else
 * lane by lane. */
SL_POW_INLINE SL_F SL_FN(pow_listed)(SL_F x, SL_F y) {
  SL_F r;
  SL_POW_LIST(SL_POW_ALL)
  r = SL_FN(pow_general)(x, y);
  SL_POW_LIST(SL_POW_ANY)
  return r;
}
#undef SL_POW_ALL
#undef SL_POW_ANY

static inline SL_F SL_FN(pow)(SL_F x, SL_F y) {
  SL_B low = SL_FN(bits)(y) << 13;
  if (SL_LIKELY(!SL_FN(any)(SL_POW_LISTED(low)))) return SL_FN(pow_general)(x, y);
  return SL_FN(pow_listed)(x, y);
}
#else
static inline SL_F SL_CHECKED(pow)(SL_F x, SL_F y SL_OK) {
  SL_B low = SL_FN(bits)(y) << 13;
  *ok &= SL_FN(not)(SL_POW_LISTED(low));
  return SL_CHECKED(pow_general)(x, y SL_PASS_OK);
}
#endif

#undef SL_F
#undef SL_B
#undef SL_M
#undef SL_FN
#undef SL_CHECKED
#undef SL_OK
#undef SL_PASS_OK
#undef SL_SCALAR
#undef SL_CORES
#undef SL_POW_INLINE
#undef SL_DEFINE_PATCH1
#undef SL_DEFINE_PATCH2
#undef SL_PATCH1
#undef SL_PATCH2
#endif /* SL_FN */
