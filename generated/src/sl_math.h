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
    ((FLT_EVAL_METHOD < 0) || (FLT_EVAL_METHOD == 2) || (FLT_EVAL_METHOD > 64))
#error "sl_math.h needs doubles evaluated as double: on x86 compile with -msse2 -mfpmath=sse"
#endif
typedef char sl_double_has_the_size_of_uint64_t[(sizeof(double) == sizeof(uint64_t)) ? 1 : -1];
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
static inline double sl_pick(uint64_t at, double a, double b) { return ((at >> 63) != 0) ? b : a; }
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
  return p * sl_real((uint64_t)(half + 1023) << 52) * sl_real((uint64_t)(k - half + 1023) << 52);
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
#define SL_PATCH_REDUCE(ok, x, hi, lo, n)                \
  do {                                                   \
    if (!SL_LIKELY(ok)) (n) = sl_reduce_rare(x, hi, lo); \
  } while (0)
#endif /* SL_MATH_H */

/* ---- Part 2: kernels, once per SL_FN --------------------------------------------------------- */
#ifdef SL_FN

/* + SL_FIELD_BIAS */
#define SL_EXPONENT_OF(shifted) SL_FN(real)(((shifted) >> 52) ^ UINT64_C(0x4330000000000800))
/* 2^52 + 2048 */
#define SL_FIELD_BIAS 4503599627372544.0
/* x >= DBL_MIN and finite, from shifted = bits(x) - start */
#define SL_IS_NORMAL(shifted, start) \
  SL_FN(below)((shifted) + (start) - UINT64_C(0x0010000000000000), UINT64_C(0x7fe0000000000000))

#ifdef SL_CORES
static inline SL_F SL_FN(sq)(SL_F x) { return x * x; }

static inline SL_F SL_FN(fabs)(SL_F x) { return SL_FN(real)(SL_FN(bits)(x) & ~SL_SIGN_BIT); }

static inline SL_F SL_FN(copysign)(SL_F x, SL_F sign) {
  return SL_FN(real)((SL_FN(bits)(x) & ~SL_SIGN_BIT) | (SL_FN(bits)(sign) & SL_SIGN_BIT));
}

/* -1, 1, or x itself where x is a zero or NaN. */
static inline SL_F SL_FN(sign)(SL_F x) {
  return SL_FN(select)(x > 0.0, SL_FN(set)(1.0), SL_FN(select)(x < 0.0, SL_FN(set)(-1.0), x));
}

/* x + 2^52 - 2^52 rounds |x| < 2^52 to the nearest integer; one comparison mends the direction. */
static inline SL_F SL_FN(floor)(SL_F x) {
  SL_F shift = SL_FN(copysign)(SL_FN(set)(0x1p52), x), n = (x + shift) - shift;
  n = n - SL_FN(if)(n > x, SL_FN(set)(1.0));
  return SL_FN(select)(SL_FN(fabs)(x) < 0x1p52, SL_FN(copysign)(n, x), x);
}

static inline SL_F SL_FN(ceil)(SL_F x) {
  SL_F shift = SL_FN(copysign)(SL_FN(set)(0x1p52), x), n = (x + shift) - shift;
  n = n + SL_FN(if)(n < x, SL_FN(set)(1.0));
  return SL_FN(select)(SL_FN(fabs)(x) < 0x1p52, SL_FN(copysign)(n, x), x);
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
  SL_F q = (x * x) + (y * y), r = SL_FN(sqrt)(q);
  SL_PATCH2((q > 0x1p-900) & (q < 0x1p1000), r, hypot_rare, x, y);
  return r;
}

/* ---- exp, expm1 ---------------------------------------------------------------------------------
 * x = k ln 2 + r, |r| <= ln 2 / 2, exp(r) = 1 + r + r^2 P(r) with P minimax of degree 9.  r comes
 * as rh, which is exact, and rl: adding the small terms to each other first and rh last keeps the
 * error below 1 ulp. */
#ifdef SL_CORES
/* rl + r^2 P(r) */
static inline SL_F SL_FN(exp_tail)(SL_F rh, SL_F rl) {
  SL_F r = rh + rl, r2 = r * r, r4 = r2 * r2;
  SL_F p01 = 0x1.000000000000cp-1 + (r * 0x1.5555555555561p-3);
  SL_F p23 = 0x1.555555554ff92p-5 + (r * 0x1.111111110d5cep-7);
  SL_F p45 = 0x1.6c16c185cac53p-10 + (r * 0x1.a01a01bb06d7ep-13);
  SL_F p67 = 0x1.a0199630e5d3fp-16 + (r * 0x1.71dddf79ade3cp-19);
  SL_F p89 = 0x1.28b0a6e418617p-22 + (r * 0x1.af860aa738e43p-26);
  return rl + (r2 * ((p01 + (r2 * p23)) + (r4 * ((p45 + (r2 * p67)) + (r4 * p89)))));
}

/* exp(hi + lo) for |hi| < 708, where k can be added to the exponent. */
static inline SL_F SL_FN(exp_sum)(SL_F hi, SL_F lo) {
  SL_F t = (hi * 0x1.71547652b82fep+0) + SL_ROUND, k = t - SL_ROUND, rh = hi - (k * SL_LN2_HI);
  SL_F m = 1.0 + (rh + SL_FN(exp_tail)(rh, lo - (k * SL_LN2_LO)));
  return SL_FN(real)(SL_FN(bits)(m) + (SL_FN(bits)(t) << 52));
}

/* exp(x) - 1 = 2^k (1 + r + ...) - 1 for |x| < 708, and in *lo what its rounding left over.  s =
 * 2^k: s - 1 and s rh are added while both are exact or nearly so. */
static inline SL_F SL_FN(expm1_sum)(SL_F x, SL_F *lo) {
  SL_F t = (x * 0x1.71547652b82fep+0) + SL_ROUND, k = t - SL_ROUND, rh = x - (k * SL_LN2_HI);
  SL_F s = SL_FN(real)((SL_FN(bits)(t) << 52) + SL_ONE), a = (s - 1.0) + (s * rh);
  SL_F b = s * SL_FN(exp_tail)(rh, k * -SL_LN2_LO), r = a + b;
  *lo = (a - r) + b;
  return r;
}

#ifdef SL_SCALAR
/* 2^shift exp(hi + lo) for every hi but NaN: overflow, denormal results. */
static inline double sl_exp_sum_rare(double hi, double lo, int shift) {
  double k, rh;
  if (hi > 711.0) return SL_INF;
  if (hi < -746.0) return 0.0;
  k = ((hi * 0x1.71547652b82fep+0) + SL_ROUND) - SL_ROUND;
  rh = hi - (k * SL_LN2_HI);
  return sl_scale(1.0 + (rh + sl_exp_tail(rh, lo - (k * SL_LN2_LO))), (int)k + shift);
}

SL_RARE double sl_exp_rare(double x) { return (x != x) ? x : sl_exp_sum_rare(x, 0.0, 0); }
SL_RARE double sl_expm1_rare(double x) {
  return (x != x) ? x : (x < 0.0) ? -1.0 : sl_exp_sum_rare(x, 0.0, 0);
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
  SL_F t = (x * 0x1.71547652b82fep+0) + SL_ROUND, k = t - SL_ROUND, rh = x - (k * SL_LN2_HI);
  SL_F m = 1.0 + (rh + SL_FN(exp_tail)(rh, k * -SL_LN2_LO));
  SL_F r = SL_FN(real)(SL_FN(bits)(m) + (SL_FN(bits)(t) << 52));
  SL_PATCH1(SL_FN(fabs)(x) < 708.0, r, exp_rare, x);
  return r;
}

static inline SL_F SL_CHECKED(expm1)(SL_F x SL_OK) {
  SL_F lo, r = SL_FN(copysign)(SL_FN(expm1_sum)(x, &lo), x);
  SL_PATCH1(SL_FN(fabs)(x) < 708.0, r, expm1_rare, x);
  return r;
}

static inline SL_F SL_CHECKED(cosh)(SL_F x SL_OK) {
  SL_F e = SL_FN(exp_sum)(SL_FN(fabs)(x), SL_FN(set)(0.0)), r = (0.5 * e) + (0.5 / e);
  SL_PATCH1(SL_FN(fabs)(x) < 708.0, r, cosh_rare, x);
  return r;
}

/* (e + e / (1 + e)) / 2 with e + lo = exp|x| - 1; what the roundings of e and 1 + e left over
 * enters to first order. */
static inline SL_F SL_CHECKED(sinh)(SL_F x SL_OK) {
  SL_F lo, e = SL_FN(expm1_sum)(SL_FN(fabs)(x), &lo), u = 1.0 + e, q = e / u, v = 1.0 - q;
  SL_F r = 0.5 * (e + (q + ((lo * (1.0 + (v * v))) - (q * v * (e - (u - 1.0))))));
  r = SL_FN(copysign)(r, x);
  SL_PATCH1(SL_FN(fabs)(x) < 708.0, r, sinh_rare, x);
  return r;
}

#ifdef SL_CORES
/* With e + lo = exp(2|x|) - 1: e / (2 + e), mended likewise, which is 1 - 2 / (2 + e); 1 to the
 * last bit from 30 on. */
static inline SL_F SL_FN(tanh)(SL_F x) {
  SL_F lo, a = SL_FN(fabs)(x), e = SL_FN(expm1_sum)(2.0 * SL_FN(fmin)(SL_FN(set)(30.0), a), &lo),
           u = 2.0 + e;
  SL_M small = a < 0.55;
  SL_F q = SL_FN(select)(small, e, SL_FN(set)(2.0)) / u, v = 0.5 * (1.0 - q);
  SL_F r = SL_FN(select)(small, q + (v * ((2.0 * v * lo) - (q * (e - (u - 2.0))))), 1.0 - q);
  return SL_FN(copysign)(r, x);
}
#endif

/* ---- log, log1p ---------------------------------------------------------------------------------
 * x = 2^k m with m in [sqrt(1/2), sqrt(2)), f = m - 1, s = f / (2 + f), log m = 2 atanh s. */
#define SL_SQRT_HALF UINT64_C(0x3fe6a09e667f3bcd)
#ifdef SL_CORES
/* k ln2_hi + lo + log(1 + f) */
static inline SL_F SL_FN(log_sum)(SL_F k, SL_F f, SL_F lo) {
  SL_F s = f / (2.0 + f), z = s * s, w = z * z, half = 0.5 * f * f;
  SL_F p =
      (0x1.5555555555592p-1 + (z * 0x1.999999997fd37p-2)) +
      (w *
       ((0x1.24924941f8d20p-2 + (z * 0x1.c71c5202b27cdp-3)) +
        (w * ((0x1.7466405bfb1c1p-3 + (z * 0x1.39a1933386ffcp-3)) + (w * 0x1.2f0705ae6bc4fp-3)))));
  return (k * SL_LN2_HI) - ((half - ((s * (half + (z * p))) + lo)) - f);
}

#ifdef SL_SCALAR
SL_RARE double sl_log_rare(double x) {
  uint64_t b, shifted;
  double k;
  if ((x != x) || (x == SL_INF)) return x;
  if (x == 0.0) return -SL_INF;
  if (x < 0.0) return SL_NAN;
  b = sl_bits(x * 0x1p54);
  shifted = b - SL_SQRT_HALF;
  k = SL_EXPONENT_OF(shifted) - (SL_FIELD_BIAS + 54.0);
  return sl_log_sum(k, sl_real(b - (shifted & ~SL_FRACTION)) - 1.0, k * SL_LN2_LO);
}
#endif
SL_DEFINE_PATCH1(log_rare)
#endif

static inline SL_F SL_CHECKED(log)(SL_F x SL_OK) {
  SL_B b = SL_FN(bits)(x), shifted = b - SL_SQRT_HALF;
  SL_F k = SL_EXPONENT_OF(shifted) - SL_FIELD_BIAS;
  SL_F r = SL_FN(log_sum)(k, SL_FN(real)(b - (shifted & ~SL_FRACTION)) - 1.0, k * SL_LN2_LO);
  SL_PATCH1(SL_IS_NORMAL(shifted, SL_SQRT_HALF), r, log_rare, x);
  return r;
}

#ifdef SL_CORES
#ifdef SL_SCALAR
/* x <= -1, NaN, or so large (2^1000) that 1 is nothing to it */
SL_RARE double sl_log1p_rare(double x) { return (x > 1.0) ? sl_log(x) : sl_log_rare(1.0 + x); }
#endif
SL_DEFINE_PATCH1(log1p_rare)
#endif

/* 1 + x rounded gives k alone: f = x 2^-k + (2^-k - 1) is exact but for k = 1, x < 1/2, where
 * `lost` is what f cannot hold.  The sign is x's; that matters for -0 only. */
static inline SL_F SL_CHECKED(log1p)(SL_F x SL_OK) {
  SL_B shifted = SL_FN(bits)(1.0 + x) - SL_SQRT_HALF;
  SL_F k = SL_EXPONENT_OF(shifted) - SL_FIELD_BIAS,
       scale = SL_FN(real)(SL_ONE - (shifted & ~SL_FRACTION));
  SL_F xs = x * scale, one = scale - 1.0, f = xs + one, lost = (one - f) + xs;
  SL_F r = SL_FN(log_sum)(k, f, (k * SL_LN2_LO) + lost);
  r = SL_FN(real)(SL_FN(bits)(r) | (SL_FN(bits)(x) & SL_SIGN_BIT));
  SL_PATCH1(SL_FN(below)(shifted + (SL_SQRT_HALF - UINT64_C(0x3c90000000000000)),
                         UINT64_C(0x41f0000000000000)),
            r, log1p_rare, x);
  return r;
}

/* ---- sin, cos, tan ------------------------------------------------------------------------------
 * x = n pi/2 + r, |r| <= pi/4, r as hi + lo.  Two 36-bit pieces of pi/2 and a double: n times a
 * piece is exact. */
#ifdef SL_CORES
#ifdef SL_SCALAR
static inline void sl_mul64(uint64_t a, uint64_t b, uint64_t *hi, uint64_t *lo) {
  uint64_t a0 = a & 0xffffffffu, a1 = a >> 32, b0 = b & 0xffffffffu, b1 = b >> 32;
  uint64_t low = a0 * b0, mid = (a1 * b0) + (low >> 32), mid2 = (a0 * b1) + (mid & 0xffffffffu);
  *hi = (a1 * b1) + (mid >> 32) + (mid2 >> 32);
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
                      : ((two_over_pi[word] << bit) | (two_over_pi[word + 1] >> (64 - bit)));
  }
  sl_mul64(m, t[2], &h, &p2); /* p = m t modulo 2^192; 2^190 is a quarter turn */
  sl_mul64(m, t[1], &n, &l);
  p1 = l + h;
  p0 = (m * t[0]) + n + (p1 < l);
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
  return ((b & SL_SIGN_BIT) != 0) ? (0 - n) : n;
}
#endif
#endif

/* n in the low bits of the result */
static inline SL_B SL_CHECKED(reduce)(SL_F x, SL_F *hi, SL_F *lo SL_OK) {
  SL_F t = (x * 0x1.45f306dc9c883p-1) + SL_ROUND, k = t - SL_ROUND;
  SL_F a = x - (k * 0x1.921fb54440000p+0), b = k * 0x1.68c234c4c0000p-39, r = a - b;
  SL_B n = SL_FN(bits)(t);
  *hi = r;
  *lo = ((a - r) - b) - (k * 0x1.98a2e03707345p-77);
  SL_PATCH_REDUCE(SL_FN(fabs)(x) < 0x1p17, x, hi, lo, n);
  return n;
}

/* Both polynomials of r, swapped and signed by n. */
static inline void SL_CHECKED(sincos)(SL_F x, SL_F *sine, SL_F *cosine SL_OK) {
  SL_F r, y, z, w, v, half, s, c;
  SL_B n = SL_CHECKED(reduce)(x, &r, &y SL_PASS_OK), odd = n << 63, upper = n << 62;
  z = r * r;
  w = z * z;
  v = z * r;
  half = 0.5 * z;
  s = (-0x1.5555555555549p-3 + (z * 0x1.111111110f87ap-7)) +
      (w * ((-0x1.a01a019c11992p-13 + (z * 0x1.71de3577b6633p-19)) +
            (w * (-0x1.ae5e663a62750p-26 + (z * 0x1.5d9300ee9c9afp-33)))));
  c = (0x1.555555555554cp-5 + (z * -0x1.6c16c16c1517ep-10)) +
      (w * ((0x1.a01a019cb1bd8p-16 + (z * -0x1.27e4f809f0783p-22)) +
            (w * (0x1.1ee9ebe91257dp-29 + (z * -0x1.8fae9c690c6dcp-37)))));
  s = r - (((half * y) - y) - (v * s));
  c = 1.0 - (half - ((w * c) - (r * y)));
  *sine = SL_FN(real)(SL_FN(bits)(SL_FN(pick)(odd, s, c)) ^ (upper & SL_SIGN_BIT));
  *cosine = SL_FN(real)(SL_FN(bits)(SL_FN(pick)(odd, c, s)) ^ ((upper ^ odd) & SL_SIGN_BIT));
}

static inline SL_F SL_CHECKED(sin)(SL_F x SL_OK) {
  SL_F s, c;
  SL_CHECKED(sincos)(x, &s, &c SL_PASS_OK);
  return s;
}

static inline SL_F SL_CHECKED(cos)(SL_F x SL_OK) {
  SL_F s, c;
  SL_CHECKED(sincos)(x, &s, &c SL_PASS_OK);
  return c;
}

/* tan r = r + r^3 T(r^2); in odd quarters -1 / tan r, divided with the remainder carried along. */
static inline SL_F SL_CHECKED(tan)(SL_F x SL_OK) {
  SL_F r, y, z, w, w2, u, t, tl, th, q, qh, p;
  SL_B n = SL_CHECKED(reduce)(x, &r, &y SL_PASS_OK);
  z = r * r;
  w = z * z;
  w2 = w * w;
  p = ((0x1.555555555555ep-2 + (z * 0x1.111111111055ap-3)) +
       (w * (0x1.ba1ba1bac4c32p-5 + (z * 0x1.664f485c1bab1p-6)))) +
      (w2 * (((0x1.226e3a9e886fbp-7 + (z * 0x1.d6d2e39832e19p-9)) +
              (w * (0x1.7db1c05e29ffap-10 + (z * 0x1.34ba7d4ef2468p-11)))) +
             (w2 * (((0x1.ff4176552c0b4p-13 + (z * 0x1.5e2b7a21d8bd5p-14)) +
                     (w * (0x1.1a619f52cd4e0p-14 + (z * -0x1.afb387026147cp-16)))) +
                    (w2 * ((0x1.98753227f4433p-15 + (z * -0x1.9784455fb73b8p-16)) +
                           (w * 0x1.48d6819ff4912p-17)))))));
  u = r * z * p;
  t = r + u;
  u = u + (y * (1.0 + (t * t)));
  t = r + u;
  tl = u - (t - r);
  th = SL_FN(real)(SL_FN(bits)(t) & SL_HIGH_26);
  q = -1.0 / t;
  qh = SL_FN(real)(SL_FN(bits)(q) & SL_HIGH_26);
  q = qh + (q * ((1.0 + (qh * th)) + (qh * ((t - th) + tl))));
  return SL_FN(select)(x == 0.0, x, SL_FN(pick)(n << 63, t, q));
}

/* ---- atan, atan2, asin, acos ----------------------------------------------------------------- */
#ifdef SL_CORES
/* The angle in [0, pi/2] whose tangent is y / x, both positive: atan c + atan t with c = 0, 1/2, 1,
 * 3/2 or infinite, c = b / a and t = (a y - b x) / (a x + b y), |t| <= 7/16. */
static inline SL_F SL_FN(angle)(SL_F y, SL_F x) {
  SL_M m1 = y >= (0.4375 * x), m2 = y >= (0.6875 * x), m3 = y >= (1.1875 * x),
       m4 = y >= (2.4375 * x);
  SL_F a = SL_FN(select)(m4, SL_FN(set)(0.0),
                         SL_FN(select)(m2, SL_FN(set)(1.0), SL_FN(set)(1.0) + SL_FN(true)(m1)));
  SL_F b = SL_FN(select)(m4, SL_FN(set)(1.0), SL_FN(select)(m3, SL_FN(set)(1.5), SL_FN(true)(m1)));
  SL_F hi = SL_FN(if)(m1, SL_FN(set)(0x1.dac670561bb4fp-2)),
       lo = SL_FN(if)(m1, SL_FN(set)(0x1.a2b7f222f65e2p-56));
  SL_F t, z, w, p;
  hi = SL_FN(select)(m2, SL_FN(set)(0x1.921fb54442d18p-1), hi);
  lo = SL_FN(select)(m2, SL_FN(set)(0x1.1a62633145c07p-55), lo);
  hi = SL_FN(select)(m3, SL_FN(set)(0x1.f730bd281f69bp-1), hi);
  lo = SL_FN(select)(m3, SL_FN(set)(0x1.007887af0cbbdp-56), lo);
  hi = SL_FN(select)(m4, SL_FN(set)(0x1.921fb54442d18p+0), hi);
  lo = SL_FN(select)(m4, SL_FN(set)(0x1.1a62633145c07p-54), lo);
  t = ((a * y) - (b * x)) / ((a * x) + (b * y));
  z = t * t;
  w = z * z;
  p = (-0x1.555555555550cp-2 + (z * 0x1.999999998e9bcp-3)) +
      (w * ((-0x1.2492491ffcd99p-3 + (z * 0x1.c71c6fde2bd99p-4)) +
            (w * ((-0x1.745cdbebc1a5fp-4 + (z * 0x1.3b0f2453d8041p-4)) +
                  (w * ((-0x1.10d625585003ep-4 + (z * 0x1.dddf46d42df51p-5)) +
                        (w * ((-0x1.97a61cc5ac210p-5 + (z * 0x1.2b228d2b176c3p-5)) +
                              (w * -0x1.0a908cd5e801ap-6)))))))));
  return hi + (t + (lo + (t * z * p)));
}

static inline SL_F SL_FN(atan)(SL_F x) {
  return SL_FN(copysign)(
      SL_FN(angle)(SL_FN(fmin)(SL_FN(set)(0x1p1000), SL_FN(fabs)(x)), SL_FN(set)(1.0)), x);
}

#ifdef SL_SCALAR
/* Infinities are compared by kind, zeros lie on an axis, everything else only needs another scale.
 */
SL_RARE double sl_atan2_rare(double y, double x) {
  double a = sl_fabs(y), b = sl_fabs(x), most = sl_fmax(a, b), r;
  double scale = (most > 0x1p1000) ? 0x1p-100 : (most < 0x1p-900) ? 0x1p100 : 1.0;
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

/* P of asin s = s + s^3 P(s^2), 0 <= s^2 <= 1/4, times s^2 */
static inline SL_F SL_FN(asin_tail)(SL_F z) {
  SL_F w = z * z;
  return z *
         ((0x1.5555555555384p-3 + (z * 0x1.333333336fdcfp-4)) +
          (w *
           ((0x1.6db6db419c1aep-5 + (z * 0x1.f1c72c7fb16b6p-6)) +
            (w * ((0x1.6e89edb72d898p-6 + (z * 0x1.1c6c42d843f7ep-6)) +
                  (w * ((0x1.c6f65bee06e06p-7 + (z * 0x1.8ef2e7d389800p-7)) +
                        (w * ((0x1.aa363bb0cc3e7p-8 + (z * 0x1.41091db8c8729p-6)) +
                              (w * (-0x1.0b7fe0b5d7d56p-6 + (z * 0x1.05feb94ced0f5p-5))))))))))));
}

/* From 1/2 on by asin x = pi/2 - 2 asin s, s = sqrt((1 - x) / 2) = sh + sl. */
static inline SL_F SL_FN(asin)(SL_F x) {
  SL_F a = SL_FN(fabs)(x), z, s, sh, sl, tail, p, q;
  SL_M small = a < 0.5;
  z = SL_FN(select)(small, a * a, 0.5 * (1.0 - a));
  s = SL_FN(sqrt)(z);
  sh = SL_FN(real)(SL_FN(bits)(s) & SL_HIGH_26);
  sl = (z - (sh * sh)) / SL_FN(fmax)(SL_FN(set)(DBL_MIN), s + sh);
  tail = SL_FN(asin_tail)(z);
  p = (2.0 * s * tail) - (0x1.1a62633145c07p-54 - (2.0 * sl));
  q = 0x1.921fb54442d18p-1 - (2.0 * sh);
  return SL_FN(copysign)(SL_FN(select)(small, a + (a * tail), 0x1.921fb54442d18p-1 - (p - q)), x);
}

static inline SL_F SL_FN(acos)(SL_F x) {
  SL_F a = SL_FN(fabs)(x), z, s, sh, sl, tail, w, r;
  SL_M small = a < 0.5;
  z = SL_FN(select)(small, a * a, 0.5 * (1.0 - a));
  s = SL_FN(sqrt)(z);
  sh = SL_FN(real)(SL_FN(bits)(s) & SL_HIGH_26);
  sl = (z - (sh * sh)) / SL_FN(fmax)(SL_FN(set)(DBL_MIN), s + sh);
  tail = SL_FN(asin_tail)(z);
  w = s * tail;
  r = SL_FN(select)(x < 0.0, 0x1.921fb54442d18p+0 - (s + (w - 0x1.1a62633145c07p-54)),
                    sh + (w + sl));
  return SL_FN(select)(small, 0x1.921fb54442d18p+0 - (x - (0x1.1a62633145c07p-54 - (x * tail))),
                       r + r);
}
#endif

static inline SL_F SL_CHECKED(atan2)(SL_F y, SL_F x SL_OK) {
  SL_F a = SL_FN(fabs)(y), b = SL_FN(fabs)(x), r = SL_FN(angle)(a, b);
  r = SL_FN(select)(x < 0.0, 0x1.921fb54442d18p+1 - (r - 0x1.1a62633145c07p-53), r);
  r = SL_FN(copysign)(r, y);
  SL_PATCH2((a > 0x1p-1000) & (a < 0x1p1000) & (b > 0x1p-1000) & (b < 0x1p1000), r, atan2_rare, y,
            x);
  return r;
}

/* ---- the cube-root family -----------------------------------------------------------------------
 * y ~ x^(-1/3) from the bits of x divided by -3 (in floating point: lanes have no 64-bit division),
 * one step of third order, then cut to 17 bits so that y^3 is exact: x^(-1/3) = y (1 + d), d from h
 * = 1 - x y^3. */
#ifdef SL_CORES
static inline SL_F SL_FN(rcbrt_parts)(SL_F x, SL_F *d) {
  SL_F t = SL_FN(real)((SL_FN(bits)(x) >> 20) | UINT64_C(0x4330000000000000));
  SL_F y = SL_FN(real)(SL_FN(bits)(0x1.55aa943ece2a5p+52 - (t * 0x1.5555555555555p-2)) << 20);
  SL_F h = 1.0 - (x * (y * y * y));
  y = y + ((y * h) *
           (0x1.5553d34e15d9fp-2 + (h * (0x1.c9afb5eeada12p-3 + (h * 0x1.65cc774f45369p-3)))));
  y = SL_FN(real)(SL_FN(bits)(y) & UINT64_C(0xfffffff000000000));
  h = 1.0 - (x * (y * y * y));
  *d = h * (0x1.5555555555555p-2 + (h * (0x1.c71c71c71c71cp-3 + (h * 0x1.61f9add3c0ca4p-3))));
  return y;
}

/* x^(-1/3), x^(-2/3) = y^2 (1 + d)^2, x^(1/3) = x y^2 (1 + d)^2, x^(2/3) = x y (1 + d).  The
 * leading products are exact, x cut to 19 or 26 bits for that, and the small rest is added last. */
static inline SL_F SL_FN(m1_3_sum)(SL_F x) {
  SL_F d, y = SL_FN(rcbrt_parts)(x, &d);
  return y + (y * d);
}

static inline SL_F SL_FN(m2_3_sum)(SL_F x) {
  SL_F d, y = SL_FN(rcbrt_parts)(x, &d), y2 = y * y;
  return y2 + (y2 * (d + d + (d * d)));
}

static inline SL_F SL_FN(p1_3_sum)(SL_F x) {
  SL_F d, y = SL_FN(rcbrt_parts)(x, &d), y2 = y * y;
  SL_F xh = SL_FN(real)(SL_FN(bits)(x) & UINT64_C(0xfffffffc00000000));
  return (xh * y2) + (((x - xh) * y2) + ((x * y2) * (d + d + (d * d))));
}

static inline SL_F SL_FN(p2_3_sum)(SL_F x) {
  SL_F d, y = SL_FN(rcbrt_parts)(x, &d);
  SL_F xh = SL_FN(real)(SL_FN(bits)(x) & SL_HIGH_26);
  return (xh * y) + (((x - xh) * y) + ((x * y) * d));
}

#ifdef SL_SCALAR
/* x^(thirds/3) of what the fast path leaves out: zeros, infinities, NaN, negative, very small and
 * very large x. */
SL_RARE double sl_thirds_rare(double x, int thirds) {
  double scale, back; /* (scale x)^(1/3) back = x^(1/3) */
  if (x != x) return x;
  if ((x == 0.0) || (sl_fabs(x) == SL_INF)) return ((x == 0.0) == (thirds > 0)) ? 0.0 : SL_INF;
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
#endif
SL_DEFINE_PATCH1(p1_3_rare)
SL_DEFINE_PATCH1(p2_3_rare)
SL_DEFINE_PATCH1(m1_3_rare)
SL_DEFINE_PATCH1(m2_3_rare)
#endif
/* 2^-1000 <= x < 2^1000, where y^3 is neither denormal nor infinite */
#define SL_THIRDS_OK(x) \
  SL_FN(below)(SL_FN(bits)(x) - UINT64_C(0x0170000000000000), UINT64_C(0x7d00000000000000))

static inline SL_F SL_CHECKED(pow_p1_3)(SL_F x SL_OK) {
  SL_F r = SL_FN(p1_3_sum)(x);
  SL_PATCH1(SL_THIRDS_OK(x), r, p1_3_rare, x);
  return r;
}

static inline SL_F SL_CHECKED(pow_p2_3)(SL_F x SL_OK) {
  SL_F r = SL_FN(p2_3_sum)(x);
  SL_PATCH1(SL_THIRDS_OK(x), r, p2_3_rare, x);
  return r;
}

static inline SL_F SL_CHECKED(pow_m1_3)(SL_F x SL_OK) {
  SL_F r = SL_FN(m1_3_sum)(x);
  SL_PATCH1(SL_THIRDS_OK(x), r, m1_3_rare, x);
  return r;
}

static inline SL_F SL_CHECKED(pow_m2_3)(SL_F x SL_OK) {
  SL_F r = SL_FN(m2_3_sum)(x);
  SL_PATCH1(SL_THIRDS_OK(x), r, m2_3_rare, x);
  return r;
}

static inline SL_F SL_CHECKED(cbrt)(SL_F x SL_OK) {
  return SL_FN(copysign)(SL_CHECKED(pow_p1_3)(SL_FN(fabs)(x) SL_PASS_OK), x);
}

/* ---- pow ----------------------------------------------------------------------------------------
 * First the other exponents with a kernel of their own. */
#ifdef SL_CORES
static inline SL_F SL_FN(pow_p1)(SL_F x) { return x; }
static inline SL_F SL_FN(pow_m1)(SL_F x) { return 1.0 / x; }
static inline SL_F SL_FN(pow_p2)(SL_F x) { return x * x; }
static inline SL_F SL_FN(pow_p3)(SL_F x) { return x * x * x; }

#ifdef SL_SCALAR /* unlike sqrt, pow(-inf, 1/2) = +inf */
SL_RARE double sl_half_rare(double x) { return -x; }
SL_RARE double sl_minus_half_rare(double x) { return -1.0 / x; }
#endif
SL_DEFINE_PATCH1(half_rare)
SL_DEFINE_PATCH1(minus_half_rare)
#endif

static inline SL_F SL_CHECKED(pow_p1_2)(SL_F x SL_OK) {
  SL_F r = SL_FN(sqrt)(x) + 0.0; /* +0 for -0 */
  SL_PATCH1(x != -SL_INF, r, half_rare, x);
  return r;
}

static inline SL_F SL_CHECKED(pow_m1_2)(SL_F x SL_OK) {
  SL_F r = 1.0 / (SL_FN(sqrt)(x) + 0.0);
  SL_PATCH1(x != -SL_INF, r, minus_half_rare, x);
  return r;
}

static inline SL_F SL_CHECKED(pow_p3_2)(SL_F x SL_OK) {
  SL_F r = x * SL_FN(sqrt)(x);
  SL_PATCH1(x != -SL_INF, r, half_rare, x);
  return r;
}

#ifdef SL_CORES
/* *hi + *lo = y log x to about 2^-63 relative, for normal positive x with its bits shifted by
 * SL_POW_START and `bias` SL_FIELD_BIAS plus the scaling of x.  x = 2^k m; m / c is near 1 for one
 * of four 26-bit numbers c whose logarithms are almost doubles; s = (m - c) / (m + c) as sh + sl,
 * log m = log c + 2 atanh s. */
#define SL_POW_START UINT64_C(0x3fed580000000000)
static inline void SL_FN(pow_log)(SL_B shifted, SL_F y, double bias, SL_F *hi, SL_F *lo) {
  SL_B first = shifted << 12, second = shifted << 13;
  SL_F k = SL_EXPONENT_OF(shifted) - bias, m = SL_FN(real)((shifted & SL_FRACTION) + SL_POW_START);
  SL_F c = SL_FN(pick)(first, SL_FN(pick)(second, SL_FN(set)(1.0), SL_FN(set)(0x1.2d26acp+0)),
                       SL_FN(pick)(second, SL_FN(set)(0x1.72d4cp+0), SL_FN(set)(0x1.b372a8p+0)));
  SL_F log_c = SL_FN(pick)(
      first, SL_FN(pick)(second, SL_FN(set)(0.0), SL_FN(set)(0x1.4caa7dcbe8acfp-3)),
      SL_FN(pick)(second, SL_FN(set)(0x1.7b7679c3bb462p-2), SL_FN(set)(0x1.0ff923a807833p-1)));
  SL_F f = m - c, u = m + c, v = 1.0 / u, s = f * v;
  SL_F sh = SL_FN(real)(SL_FN(bits)(s) & SL_HIGH_26), uh = SL_FN(real)(SL_FN(bits)(u) & SL_HIGH_26);
  SL_F sl = ((f - (sh * uh)) - (sh * (m - (uh - c)))) * v;
  SL_F ds = (sh - s) + sl; /* s + ds is the better s */
  SL_F z = s * s, w = z * z;
  SL_F p = (0x1.5555555555555p-1 + (z * 0x1.9999999999ac0p-2)) +
           (w * ((0x1.2492492413f3bp-2 + (z * 0x1.c71c74dd75d28p-3)) +
                 (w * (0x1.745845c8bb19fp-3 + (z * 0x1.3eba96fda56c4p-3)))));
  SL_F kl = k * SL_LN2_HI, t = kl + log_c, tl = (kl - t) + log_c;
  SL_F sh2 = sh + sh, h = t + sh2, rest = (tl + (k * SL_LN2_LO)) + ((sl + sl) + ((z + z) * ds));
  SL_F l = (((t - h) + sh2) + rest) + ((s * z) * p);
  SL_F lh = SL_FN(real)(SL_FN(bits)(h + l) & SL_HIGH_26), ll = (h - lh) + l;
  SL_F yh = SL_FN(real)(SL_FN(bits)(y) & SL_HIGH_26);
  *hi = yh * lh;
  *lo = (y * ll) + ((y - yh) * lh);
}

#ifdef SL_SCALAR
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
  if (sl_fabs(y) == SL_INF) return (a == 1.0) ? 1.0 : ((a > 1.0) == (y > 0.0)) ? SL_INF : 0.0;
  parity = sl_parity(y);
  if ((a == 0.0) || (a == SL_INF)) {
    r = ((a == 0.0) == (y > 0.0)) ? 0.0 : SL_INF;
  } else {
    if ((x < 0.0) && (parity == 0)) return SL_NAN;
    if (a < DBL_MIN) {
      a *= 0x1p54;
      bias += 54.0;
    }
    sl_pow_log(sl_bits(a) - SL_POW_START, y, bias, &hi, &lo);
    r = sl_exp_sum_rare(hi, lo, 0);
  }
  return (parity == 1) ? sl_copysign(r, x) : r;
}
#endif
SL_DEFINE_PATCH2(pow_rare)
#endif

/* pow for exponents that are not listed below. */
static inline SL_F SL_CHECKED(pow_general)(SL_F x, SL_F y SL_OK) {
  SL_B shifted = SL_FN(bits)(x) - SL_POW_START;
  SL_F hi, lo, r;
  SL_FN(pow_log)(shifted, y, SL_FIELD_BIAS, &hi, &lo);
  r = SL_FN(exp_sum)(hi, lo);
  SL_PATCH2(SL_IS_NORMAL(shifted, SL_POW_START) & (SL_FN(fabs)(hi) < 708.0), r, pow_rare, x, y);
  return r;
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
#undef SL_PATCH_REDUCE
#endif /* SL_FN */
