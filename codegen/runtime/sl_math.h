/*
 * sl_math.h - elementary functions that give the same bits everywhere.
 *
 * Every result is a function of the argument bits alone: the kernels use IEEE double +, -, *, /, sqrt,
 * comparisons and integer operations, nothing else.  No libm call, no table in memory, no state, no FMA.
 * Any C99 compiler, optimisation level and instruction set agrees to the last bit, provided that the
 * compiler does not contract a*b+c (pass -ffp-contract=off) and evaluates double as double.
 *
 * Errors are below 2 ulp over the whole double range (docs/math.md has the measured table); special values
 * are those of C99 Annex F.  Not reproducible: the sign and payload of a NaN.  Not supported: flush-to-zero.
 *
 * How to read this file.  Part 1 are the scalar primitives.  Part 2 are the kernels, written once in terms
 * of SL_F (real), SL_B (its bits), SL_M (mask) and SL_FN(name).  Here they become sl_name() on double;
 * sl_lanes.h includes part 2 again and makes slv_name() on vectors of W doubles.  A kernel computes the common
 * case without branches; SL_PATCH then replaces the lanes outside it by a scalar sl_name_rare().
 */
#ifndef SL_MATH_H
#define SL_MATH_H

#include <float.h>
#include <stdint.h>

#ifdef __FAST_MATH__
#error "sl_math.h needs IEEE arithmetic: compile without -ffast-math"
#endif
#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 16
#error "sl_math.h needs doubles evaluated as double: on 32-bit x86 compile with -msse2 -mfpmath=sse"
#endif
#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

#if defined(__GNUC__)
#define SL_LIKELY(c) __builtin_expect((c) != 0, 1)
#define SL_RARE static __attribute__((noinline, cold, unused))
#else
#define SL_LIKELY(c) (c)
#define SL_RARE static
#endif

/* ---- Part 1: scalar primitives ------------------------------------------------------------------------ */

#define SL_INF (sl_real(UINT64_C(0x7ff0000000000000)))
#define SL_NAN (sl_real(UINT64_C(0x7ff8000000000000)))
#define SL_SIGN_BIT UINT64_C(0x8000000000000000)
#define SL_EXPONENT UINT64_C(0x7ff0000000000000)
#define SL_HIGH_26 UINT64_C(0xfffffffff8000000) /* keeps 26 significant bits: the square of the rest is exact */
#define SL_ROUND 0x1.8p52                       /* x + SL_ROUND rounds x to an integer, held in the low bits */

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
static inline double sl_fmin(double a, double b) { return a < b ? a : b; }
static inline double sl_fmax(double a, double b) { return a > b ? a : b; }

/* The correctly rounded root by integer arithmetic alone, digit by digit, for targets without a square-root instruction. */
static inline double sl_sqrt_soft(double x) {
  uint64_t m = sl_bits(x), root = 0, twice = 0, digit;
  int e;
  if (!(x > 0.0)) return x == 0.0 ? x : SL_NAN;
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
  return sl_real((root >> 1) + ((uint64_t)(e / 2 + 1022) << 52));
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
#define SL_SCALAR
#define SL_LISTED_INLINE static inline
#define SL_DEFINE_PATCH1(name)
#define SL_DEFINE_PATCH2(name)
/* r = name(x) in the lanes where ok is false */
#define SL_PATCH1(ok, r, name, x)                       \
  do {                                                  \
    if (!SL_LIKELY(ok)) (r) = sl_##name(x);             \
  } while (0)
#define SL_PATCH2(ok, r, name, x, y)                    \
  do {                                                  \
    if (!SL_LIKELY(ok)) (r) = sl_##name(x, y);          \
  } while (0)
#define SL_PATCH_REDUCE(ok, x, hi, lo, q)               \
  do {                                                  \
    if (!SL_LIKELY(ok)) (q) = sl_reduce_rare(x, hi, lo); \
  } while (0)
#endif /* SL_MATH_H */

/* ---- Part 2: kernels, once per SL_FN -------------------------------------------------------------------- */
#ifdef SL_FN

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
  SL_F a = SL_FN(fabs)(x), shift = SL_FN(copysign)(SL_FN(set)(0x1p52), x);
  SL_F n = (x + shift) - shift;
  n = n - SL_FN(if)(n > x, SL_FN(set)(1.0));
  return SL_FN(select)(a < 0x1p52, SL_FN(copysign)(n, x), x);
}

static inline SL_F SL_FN(ceil)(SL_F x) {
  SL_F a = SL_FN(fabs)(x), shift = SL_FN(copysign)(SL_FN(set)(0x1p52), x);
  SL_F n = (x + shift) - shift;
  n = n + SL_FN(if)(n < x, SL_FN(set)(1.0));
  return SL_FN(select)(a < 0x1p52, SL_FN(copysign)(n, x), x);
}

#ifdef SL_SCALAR
SL_RARE double sl_hypot_rare(double x, double y) {
  double a = sl_fabs(x), b = sl_fabs(y), s;
  if (a == SL_INF || b == SL_INF) return SL_INF;
  if (a != a || b != b) return a + b;
  s = sl_fmax(a, b) > 1.0 ? 0x1p600 : 0x1p-600;
  a /= s;
  b /= s;
  return sl_sqrt(a * a + b * b) * s;
}
#endif
SL_DEFINE_PATCH2(hypot_rare)

static inline SL_F SL_FN(hypot)(SL_F x, SL_F y) {
  SL_F q = x * x + y * y, r = SL_FN(sqrt)(q);
  SL_PATCH2((q > 0x1p-900) & (q < 0x1p1000), r, hypot_rare, x, y);
  return r;
}

/* ---- exp, expm1 -----------------------------------------------------------------------------------------
 * hi + lo = k ln 2 + r with |r| <= ln 2 / 2.  exp(r) = 1 + a + b, where a is the exact leading part of r and b
 * holds what is left of r and r^2 P(r), P minimax of degree 9.  On return *t = k + SL_ROUND. */
static inline void SL_FN(exp_parts)(SL_F hi, SL_F lo, SL_F *t, SL_F *a, SL_F *b) {
  SL_F n = hi * 0x1.71547652b82fep+0 + SL_ROUND, k = n - SL_ROUND;
  SL_F rh = hi - k * 0x1.62e42fefa38p-1, rl = lo - k * 0x1.ef35793c7673p-45;
  SL_F r = rh + rl, r2 = r * r, r4 = r2 * r2;
  SL_F p01 = 0x1.000000000000cp-1 + r * 0x1.5555555555561p-3;
  SL_F p23 = 0x1.555555554ff92p-5 + r * 0x1.111111110d5cep-7;
  SL_F p45 = 0x1.6c16c185cac53p-10 + r * 0x1.a01a01bb06d7ep-13;
  SL_F p67 = 0x1.a0199630e5d3fp-16 + r * 0x1.71dddf79ade3cp-19;
  SL_F p89 = 0x1.28b0a6e418617p-22 + r * 0x1.af860aa738e43p-26;
  SL_F p = (p01 + r2 * p23) + r4 * ((p45 + r2 * p67) + r4 * p89);
  *t = n;
  *a = rh;
  *b = rl + r2 * p;
}

/* exp(hi + lo) for |hi| < 708, where the exponent can be added to the bits. */
static inline SL_F SL_FN(exp_sum)(SL_F hi, SL_F lo) {
  SL_F t, a, b;
  SL_FN(exp_parts)(hi, lo, &t, &a, &b);
  return SL_FN(real)(SL_FN(bits)(1.0 + (a + b)) + (SL_FN(bits)(t) << 52));
}

#ifdef SL_SCALAR
/* exp(hi + lo) for every finite hi: overflow, denormal results. */
static inline double sl_exp_sum_rare(double hi, double lo) {
  double t, a, b;
  if (hi > 710.0) return SL_INF;
  if (hi < -746.0) return 0.0;
  sl_exp_parts(hi, lo, &t, &a, &b);
  return sl_scale(1.0 + (a + b), (int)(t - SL_ROUND));
}

SL_RARE double sl_exp_rare(double x) {
  if (x != x) return x;
  return sl_exp_sum_rare(x, 0.0);
}

SL_RARE double sl_expm1_rare(double x) {
  if (x != x) return x;
  return x < 0.0 ? -1.0 : sl_exp_sum_rare(x, 0.0);
}
#endif
SL_DEFINE_PATCH1(exp_rare)
SL_DEFINE_PATCH1(expm1_rare)

static inline SL_F SL_FN(exp)(SL_F x) {
  SL_F r = SL_FN(exp_sum)(x, SL_FN(set)(0.0));
  SL_PATCH1(SL_FN(fabs)(x) < 708.0, r, exp_rare, x);
  return r;
}

static inline SL_F SL_FN(expm1)(SL_F x) {
  SL_F t, a, b, s, r;
  SL_FN(exp_parts)(x, SL_FN(set)(0.0), &t, &a, &b);
  s = SL_FN(real)((SL_FN(bits)(t) << 52) + UINT64_C(0x3ff0000000000000));
  r = SL_FN(copysign)(((s - 1.0) + s * a) + s * b, x);
  SL_PATCH1(SL_FN(fabs)(x) < 708.0, r, expm1_rare, x);
  return r;
}

/* ---- log, log1p -----------------------------------------------------------------------------------------
 * x = 2^k m with m in [sqrt(1/2), sqrt(2)), f = m - 1, s = f / (2 + f), log m = 2 atanh s. */
#define SL_SQRT_HALF UINT64_C(0x3fe6a09e667f3bcd)
/* k of the shifted bits: the 12-bit two's complement in the exponent field, as a double */
#define SL_FIELD(shifted) SL_FN(real)(((shifted) >> 52) ^ UINT64_C(0x4330000000000800))
#define SL_FIELD_BIAS 4503599627372544.0 /* 2^52 + 2048 */

/* k ln 2 + log(1 + f) + lo */
static inline SL_F SL_FN(log_sum)(SL_F k, SL_F f, SL_F lo) {
  SL_F s = f / (2.0 + f), z = s * s, w = z * z, half = 0.5 * f * f;
  SL_F p = (0x1.5555555555592p-1 + z * 0x1.999999997fd37p-2) +
           w * ((0x1.24924941f8d20p-2 + z * 0x1.c71c5202b27cdp-3) +
                w * ((0x1.7466405bfb1c1p-3 + z * 0x1.39a1933386ffcp-3) + w * 0x1.2f0705ae6bc4fp-3));
  return k * 0x1.62e42fefa38p-1 - ((half - (s * (half + z * p) + (k * 0x1.ef35793c7673p-45 + lo))) - f);
}

#ifdef SL_SCALAR
SL_RARE double sl_log_rare(double x) {
  uint64_t b, shifted;
  if (x != x || x == SL_INF) return x;
  if (x == 0.0) return -SL_INF;
  if (x < 0.0) return SL_NAN;
  b = sl_bits(x * 0x1p54);
  shifted = b - SL_SQRT_HALF;
  return sl_log_sum(SL_FIELD(shifted) - (SL_FIELD_BIAS + 54.0), sl_real(b - (shifted & ~UINT64_C(0xfffffffffffff))) - 1.0, 0.0);
}
#endif
SL_DEFINE_PATCH1(log_rare)

static inline SL_F SL_FN(log)(SL_F x) {
  SL_B b = SL_FN(bits)(x), shifted = b - SL_SQRT_HALF;
  SL_F f = SL_FN(real)(b - (shifted & ~UINT64_C(0xfffffffffffff))) - 1.0;
  SL_F r = SL_FN(log_sum)(SL_FIELD(shifted) - SL_FIELD_BIAS, f, SL_FN(set)(0.0));
  SL_PATCH1((x >= DBL_MIN) & (x <= DBL_MAX), r, log_rare, x);
  return r;
}

#ifdef SL_SCALAR
SL_RARE double sl_log1p_rare(double x) {
  return x > 1.0 ? sl_log(x) : sl_log_rare(1.0 + x);
}
#endif
SL_DEFINE_PATCH1(log1p_rare)

/* 1 + x = u + c exactly; c goes where it still counts: into f, and what f cannot hold to first order behind it. */
static inline SL_F SL_FN(log1p)(SL_F x) {
  SL_F u = 1.0 + x, v = u - 1.0, c = (1.0 - (u - v)) + (x - v);
  SL_B b = SL_FN(bits)(u), shifted = b - SL_SQRT_HALF, kk = shifted & ~UINT64_C(0xfffffffffffff);
  SL_F m = SL_FN(real)(b - kk) - 1.0, d = c * SL_FN(real)(UINT64_C(0x3ff0000000000000) - kk);
  SL_F f = m + d, lost = (m - f) + d;
  SL_F r = SL_FN(log_sum)(SL_FIELD(shifted) - SL_FIELD_BIAS, f, lost * (1.0 - f + f * f));
  r = SL_FN(copysign)(r, x);
  SL_PATCH1((x > -1.0) & (x < 0x1p1000), r, log1p_rare, x);
  return r;
}

/* ---- sin, cos, tan --------------------------------------------------------------------------------------
 * x = n pi/2 + r, |r| <= pi/4, r as hi + lo; three 33-bit pieces of pi/2 make n times each exact for |x| < 2^20. */
#ifdef SL_SCALAR
static inline void sl_mul64(uint64_t a, uint64_t b, uint64_t *hi, uint64_t *lo) {
  uint64_t a0 = a & 0xffffffffu, a1 = a >> 32, b0 = b & 0xffffffffu, b1 = b >> 32;
  uint64_t low = a0 * b0, mid = a1 * b0 + (low >> 32), mid2 = a0 * b1 + (mid & 0xffffffffu);
  *hi = a1 * b1 + (mid >> 32) + (mid2 >> 32);
  *lo = (mid2 << 32) | (low & 0xffffffffu);
}

/* Payne and Hanek: the bits of x 2/pi around the binary point, from the bits of 2/pi that matter; |x| >= 2^20.
 * Returns n mod 4 and r = hi + lo; hi is NaN for an infinite or NaN x. */
SL_RARE uint64_t sl_reduce_rare(double x, double *hi, double *lo) {
  static const uint64_t two_over_pi[20] = {
      UINT64_C(0),                  UINT64_C(0xa2f9836e4e441529), UINT64_C(0xfc2757d1f534ddc0),
      UINT64_C(0xdb6295993c439041), UINT64_C(0xfe5163abdebbc561), UINT64_C(0xb7246e3a424dd2e0),
      UINT64_C(0x06492eea09d1921c), UINT64_C(0xfe1deb1cb129a73e), UINT64_C(0xe88235f52ebb4484),
      UINT64_C(0xe99c7026b45f7e41), UINT64_C(0x3991d639835339f4), UINT64_C(0x9c845f8bbdf9283b),
      UINT64_C(0x1ff897ffde05980f), UINT64_C(0xef2f118b5a0a6d1f), UINT64_C(0x6d367ecf27cb09b7),
      UINT64_C(0x4f463f669e5fea2d), UINT64_C(0x7527bac7ebe5f17b), UINT64_C(0x3d0739f78a5292ea),
      UINT64_C(0x6bfb5fb11f8d5d08), UINT64_C(0x56033046fc7b6bab)};
  uint64_t b = sl_bits(x), m = (b & UINT64_C(0xfffffffffffff)) | (UINT64_C(1) << 52);
  uint64_t t[3], p0, p1, p2, h, l, n, sign = 0;
  int e = (int)((b & SL_EXPONENT) >> 52), first = e - 1075 - 2 + 64, i, shift;
  double scale;
  *lo = 0.0;
  if (e == 2047) {
    *hi = SL_NAN;
    return 0;
  }
  for (i = 0; i < 3; i++) { /* 192 bits of 2/pi; those before them weigh multiples of 4 turns' quarters */
    int word = first / 64 + i, bit = first % 64;
    t[i] = bit == 0 ? two_over_pi[word] : (two_over_pi[word] << bit) | (two_over_pi[word + 1] >> (64 - bit));
  }
  sl_mul64(m, t[2], &h, &p2); /* p = m t mod 2^192, in units of 2^-190 quarter turns */
  sl_mul64(m, t[1], &n, &l);
  p1 = l + h;
  p0 = m * t[0] + n + (p1 < l);
  n = p0 >> 62;
  p0 = (p0 << 2) | (p1 >> 62);
  p1 = (p1 << 2) | (p2 >> 62);
  if ((p0 >> 63) != 0) { /* beyond the half: take the next quarter, go back */
    n++;
    sign = SL_SIGN_BIT;
    p1 = ~p1;
    p0 = ~p0;
  }
  for (shift = 0; (p0 >> 63) == 0 && shift < 63; shift++) {
    p0 = (p0 << 1) | (p1 >> 63);
    p1 <<= 1;
  }
  sl_mul64(p0, UINT64_C(0xc90fdaa22168c235), &h, &l); /* pi/2 in units of 2^-63 */
  scale = sl_real((uint64_t)(1023 - 63 - shift) << 52);
  *hi = sl_real(sl_bits((double)(h >> 11) * 0x1p11 * scale) ^ sign);
  *lo = sl_real(sl_bits((double)(h & 0x7ff) * scale) ^ sign);
  if ((b & SL_SIGN_BIT) != 0) {
    *hi = -*hi;
    *lo = -*lo;
    n = 0 - n;
  }
  return n;
}
#endif

/* n in the low bits of the result; r = *hi + *lo */
static inline SL_B SL_FN(reduce)(SL_F x, SL_F *hi, SL_F *lo) {
  SL_F t = x * 0x1.45f306dc9c883p-1 + SL_ROUND, n = t - SL_ROUND;
  SL_F a = x - n * 0x1.921fb544p+0;
  SL_F b = n * 0x1.0b4611a6p-34, c = a - b, d = (a - c) - b;
  SL_F e = n * 0x1.3198a2ep-69, f = c - e, g = ((c - f) - e) + (d - n * 0x1.b839a252049c1p-104);
  SL_B q = SL_FN(bits)(t);
  *hi = f;
  *lo = g;
  SL_PATCH_REDUCE(SL_FN(fabs)(x) < 0x1p20, x, hi, lo, q);
  return q;
}

static inline void SL_FN(sincos)(SL_F x, SL_F *sine, SL_F *cosine) {
  SL_F r, y, z, w, v, half, s, c, one;
  SL_B n = SL_FN(reduce)(x, &r, &y);
  z = r * r;
  w = z * z;
  v = z * r;
  half = 0.5 * z;
  s = (-0x1.5555555555549p-3 + z * 0x1.111111110f87ap-7) +
      w * ((-0x1.a01a019c11992p-13 + z * 0x1.71de3577b6633p-19) +
           w * (-0x1.ae5e663a62750p-26 + z * 0x1.5d9300ee9c9afp-33));
  s = r - ((half * y - y) - v * s);
  c = (0x1.555555555554cp-5 + z * -0x1.6c16c16c1517ep-10) +
      w * ((0x1.a01a019cb1bd8p-16 + z * -0x1.27e4f809f0783p-22) +
           w * (0x1.1ee9ebe91257dp-29 + z * -0x1.8fae9c690c6dcp-37));
  one = 1.0 - half;
  c = one + (((1.0 - one) - half) + (w * c - r * y));
  *sine = SL_FN(real)(SL_FN(bits)(SL_FN(pick)(n << 63, s, c)) ^ ((n << 62) & SL_SIGN_BIT));
  *cosine = SL_FN(real)(SL_FN(bits)(SL_FN(pick)(n << 63, c, s)) ^ (((n + 1) << 62) & SL_SIGN_BIT));
}

static inline SL_F SL_FN(sin)(SL_F x) {
  SL_F s, c;
  SL_FN(sincos)(x, &s, &c);
  return s;
}

static inline SL_F SL_FN(cos)(SL_F x) {
  SL_F s, c;
  SL_FN(sincos)(x, &s, &c);
  return c;
}

/* tan r = r + r^3 T(r^2); in odd quarters -1/tan r, divided with the remainder carried along. */
static inline SL_F SL_FN(tan)(SL_F x) {
  SL_F r, y, z, w, w2, u, t, tl, th, q, qh, p;
  SL_B n = SL_FN(reduce)(x, &r, &y);
  z = r * r;
  w = z * z;
  w2 = w * w;
  p = ((0x1.555555555555ep-2 + z * 0x1.111111111055ap-3) + w * (0x1.ba1ba1bac4c32p-5 + z * 0x1.664f485c1bab1p-6)) +
      w2 * (((0x1.226e3a9e886fbp-7 + z * 0x1.d6d2e39832e19p-9) +
             w * (0x1.7db1c05e29ffap-10 + z * 0x1.34ba7d4ef2468p-11)) +
            w2 * (((0x1.ff4176552c0b4p-13 + z * 0x1.5e2b7a21d8bd5p-14) +
                   w * (0x1.1a619f52cd4e0p-14 + z * -0x1.afb387026147cp-16)) +
                  w2 * ((0x1.98753227f4433p-15 + z * -0x1.9784455fb73b8p-16) + w * 0x1.48d6819ff4912p-17)));
  u = r * z * p;
  t = r + u;
  u = u + y * (1.0 + t * t);
  t = r + u;
  tl = u - (t - r);
  th = SL_FN(real)(SL_FN(bits)(t) & SL_HIGH_26);
  q = -1.0 / t;
  qh = SL_FN(real)(SL_FN(bits)(q) & SL_HIGH_26);
  q = qh + q * ((1.0 + qh * th) + qh * ((t - th) + tl));
  return SL_FN(select)(x == 0.0, x, SL_FN(pick)(n << 63, t, q));
}

/* ---- the cube-root family -------------------------------------------------------------------------------
 * y ~ x^(-1/3) from the bits of x divided by -3 (in floating point: lanes have no 64-bit division), one step of
 * third order, then cut to 17 bits so that y^3 is exact: x^(-1/3) = y (1 + d) with d from h = 1 - x y^3. */
static inline SL_F SL_FN(rcbrt_parts)(SL_F x, SL_F *d) {
  SL_F t = SL_FN(real)((SL_FN(bits)(x) >> 20) | UINT64_C(0x4330000000000000));
  SL_F y = SL_FN(real)(SL_FN(bits)(0x1.55aa943ece2a5p+52 - t * 0x1.5555555555555p-2) << 20);
  SL_F h = 1.0 - x * (y * y * y);
  y = y + (y * h) * ((0x1.5553d34e15d9fp-2 + h * 0x1.c9afb5eeada12p-3) + (h * h) * 0x1.65cc774f45369p-3);
  y = SL_FN(real)(SL_FN(bits)(y) & UINT64_C(0xfffffff000000000));
  h = 1.0 - x * (y * y * y);
  *d = h * ((0x1.5555555555555p-2 + h * 0x1.c71c71c71c71cp-3) + (h * h) * 0x1.61f9add3c0ca4p-3);
  return y;
}


/* x^(-1/3), x^(-2/3) = y^2 (1 + d)^2, x^(1/3) = x y^2 (1 + d)^2, x^(2/3) = x y (1 + d): the leading products are exact,
 * x cut to 19 or 26 bits for that, and the small rest is added last. */
static inline SL_F SL_FN(m1_3_sum)(SL_F x) {
  SL_F d, y = SL_FN(rcbrt_parts)(x, &d);
  return y + y * d;
}

static inline SL_F SL_FN(m2_3_sum)(SL_F x) {
  SL_F d, y = SL_FN(rcbrt_parts)(x, &d), y2 = y * y;
  return y2 + y2 * (d + d + d * d);
}

static inline SL_F SL_FN(p1_3_sum)(SL_F x) {
  SL_F d, y = SL_FN(rcbrt_parts)(x, &d), y2 = y * y;
  SL_F xh = SL_FN(real)(SL_FN(bits)(x) & UINT64_C(0xfffffffc00000000));
  return xh * y2 + ((x - xh) * y2 + (x * y2) * (d + d + d * d));
}

static inline SL_F SL_FN(p2_3_sum)(SL_F x) {
  SL_F d, y = SL_FN(rcbrt_parts)(x, &d);
  SL_F xh = SL_FN(real)(SL_FN(bits)(x) & SL_HIGH_26);
  return xh * y + ((x - xh) * y + (x * y) * d);
}

#ifdef SL_SCALAR
/* x^(thirds/3) of what the fast path leaves out: zeros, infinities, NaN, negative, very small and very large x. */
SL_RARE double sl_thirds_rare(double x, int thirds) {
  double to, unit; /* x is multiplied by `to` = 2^(-+600), the result by unit^thirds */
  if (x != x) return x;
  if (x == 0.0 || sl_fabs(x) == SL_INF) return (x == 0.0) == (thirds > 0) ? 0.0 : SL_INF;
  if (x < 0.0) return SL_NAN;
  to = x < 1.0 ? 0x1p600 : 0x1p-600;
  unit = x < 1.0 ? 0x1p-200 : 0x1p200;
  switch (thirds) {
    case 1: return sl_p1_3_sum(x * to) * unit;
    case 2: return sl_p2_3_sum(x * to) * (unit * unit);
    case -1: return sl_m1_3_sum(x * to) / unit;
    default: return sl_m2_3_sum(x * to) / (unit * unit);
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

static inline SL_F SL_FN(pow_p1_3)(SL_F x) {
  SL_F r = SL_FN(p1_3_sum)(x);
  SL_PATCH1((x > 0x1p-1000) & (x < 0x1p1000), r, p1_3_rare, x);
  return r;
}

static inline SL_F SL_FN(pow_p2_3)(SL_F x) {
  SL_F r = SL_FN(p2_3_sum)(x);
  SL_PATCH1((x > 0x1p-1000) & (x < 0x1p1000), r, p2_3_rare, x);
  return r;
}

static inline SL_F SL_FN(pow_m1_3)(SL_F x) {
  SL_F r = SL_FN(m1_3_sum)(x);
  SL_PATCH1((x > 0x1p-1000) & (x < 0x1p1000), r, m1_3_rare, x);
  return r;
}

static inline SL_F SL_FN(pow_m2_3)(SL_F x) {
  SL_F r = SL_FN(m2_3_sum)(x);
  SL_PATCH1((x > 0x1p-1000) & (x < 0x1p1000), r, m2_3_rare, x);
  return r;
}

static inline SL_F SL_FN(cbrt)(SL_F x) { return SL_FN(copysign)(SL_FN(pow_p1_3)(SL_FN(fabs)(x)), x); }

/* ---- pow ------------------------------------------------------------------------------------------------
 * Exponents with a kernel of their own.  pow(-0, 1/2) = +0 and pow(-inf, 1/2) = +inf, unlike sqrt. */
static inline SL_F SL_FN(pow_p1_2)(SL_F x) {
  return SL_FN(select)(x == -SL_INF, SL_FN(set)(SL_INF), SL_FN(sqrt)(x) + 0.0);
}
static inline SL_F SL_FN(pow_m1_2)(SL_F x) { return 1.0 / SL_FN(pow_p1_2)(x); }
static inline SL_F SL_FN(pow_p3_2)(SL_F x) {
  return SL_FN(select)(x == -SL_INF, SL_FN(set)(SL_INF), x * SL_FN(sqrt)(x));
}
static inline SL_F SL_FN(pow_p1)(SL_F x) { return x; }
static inline SL_F SL_FN(pow_m1)(SL_F x) { return 1.0 / x; }
static inline SL_F SL_FN(pow_p2)(SL_F x) { return x * x; }
static inline SL_F SL_FN(pow_p3)(SL_F x) { return x * x * x; }

/* (*hi + *lo) = y log x, about 2^-64 relative, for normal positive x; `bias` is SL_FIELD_BIAS plus what x was scaled by.
 * x = 2^k m, m / c near 1 with c one of four 26-bit numbers whose logarithm is almost a double;
 * s = (m - c) / (m + c) as sh + sl, log m = log c + 2 atanh s. */
#define SL_POW_START UINT64_C(0x3fed580000000000)
static inline void SL_FN(pow_log)(SL_F x, SL_F y, double bias, SL_F *hi, SL_F *lo) {
  SL_B b = SL_FN(bits)(x), shifted = b - SL_POW_START, first = shifted << 12, second = shifted << 13;
  SL_F k = SL_FIELD(shifted) - bias, m = SL_FN(real)(b - (shifted & ~UINT64_C(0xfffffffffffff)));
  SL_F c = SL_FN(pick)(first, SL_FN(pick)(second, SL_FN(set)(1.0), SL_FN(set)(0x1.2d26acp+0)),
                       SL_FN(pick)(second, SL_FN(set)(0x1.72d4cp+0), SL_FN(set)(0x1.b372a8p+0)));
  SL_F log_c = SL_FN(pick)(first, SL_FN(pick)(second, SL_FN(set)(0.0), SL_FN(set)(0x1.4caa7dcbe8acfp-3)),
                           SL_FN(pick)(second, SL_FN(set)(0x1.7b7679c3bb462p-2), SL_FN(set)(0x1.0ff923a807833p-1)));
  SL_F f = m - c, u = m + c, v = 1.0 / u, s = f * v;
  SL_F sh = SL_FN(real)(SL_FN(bits)(s) & SL_HIGH_26), uh = SL_FN(real)(SL_FN(bits)(u) & SL_HIGH_26);
  SL_F sl = ((f - sh * uh) - sh * (m - (uh - c))) * v, ds = (sh - s) + sl; /* s + ds is the better s */
  SL_F z = s * s, w = z * z;
  SL_F p = (0x1.5555555555555p-1 + z * 0x1.9999999999ac0p-2) +
           w * ((0x1.2492492413f3bp-2 + z * 0x1.c71c74dd75d28p-3) + w * (0x1.745845c8bb19fp-3 + z * 0x1.3eba96fda56c4p-3));
  SL_F kl = k * 0x1.62e42fefa38p-1, t = kl + log_c, tl = (kl - t) + log_c;
  SL_F sh2 = sh + sh, h = t + sh2, rest = (tl + k * 0x1.ef35793c7673p-45) + ((sl + sl) + (z + z) * ds);
  SL_F l = (((t - h) + sh2) + rest) + (s * z) * p;
  SL_F lh = SL_FN(real)(SL_FN(bits)(h + l) & SL_HIGH_26), ll = (h - lh) + l;
  SL_F yh = SL_FN(real)(SL_FN(bits)(y) & SL_HIGH_26);
  *hi = yh * lh;
  *lo = y * ll + (y - yh) * lh;
}

#ifdef SL_SCALAR
/* 0: not an integer, 1: odd, 2: even */
static inline int sl_parity(double y) {
  double a = sl_fabs(y), h = 0.5 * a;
  if (a >= 0x1p53) return 2;
  if (sl_floor(a) != a) return 0;
  return sl_floor(h) == h ? 2 : 1;
}

/* C99 Annex F.9.4.4 in its order, then the general case with every scaling. */
SL_RARE double sl_pow_rare(double x, double y) {
  double a = sl_fabs(x), hi, lo, bias = SL_FIELD_BIAS, r;
  int parity;
  if (y == 0.0 || x == 1.0) return 1.0;
  if (x != x || y != y) return x + y;
  if (sl_fabs(y) == SL_INF) return a == 1.0 ? 1.0 : (a > 1.0) == (y > 0.0) ? SL_INF : 0.0;
  parity = sl_parity(y);
  if (a == 0.0 || a == SL_INF) {
    r = (a == 0.0) == (y > 0.0) ? 0.0 : SL_INF;
  } else {
    if (x < 0.0 && parity == 0) return SL_NAN;
    if (a < DBL_MIN) {
      a *= 0x1p54;
      bias += 54.0;
    }
    sl_pow_log(a, y, bias, &hi, &lo);
    r = sl_exp_sum_rare(hi, lo);
  }
  return parity == 1 ? sl_copysign(r, x) : r;
}
#endif
SL_DEFINE_PATCH2(pow_rare)

/* pow for exponents that are not listed below. */
static inline SL_F SL_FN(pow_general)(SL_F x, SL_F y) {
  SL_F hi, lo, r;
  SL_FN(pow_log)(x, y, SL_FIELD_BIAS, &hi, &lo);
  r = SL_FN(exp_sum)(hi, lo);
  SL_PATCH2((x >= DBL_MIN) & (x <= DBL_MAX) & (SL_FN(fabs)(hi) < 708.0), r, pow_rare, x, y);
  return r;
}

/* The exponents at which pow(x, y) is by definition the kernel pow_name(x); 1/3 and 2/3 are the nearest doubles. */
#define SL_POW_LIST(entry)          \
  entry(0x1.5555555555555p-2, p1_3) \
  entry(-0x1.5555555555555p-2, m1_3)\
  entry(0x1.5555555555555p-1, p2_3) \
  entry(-0x1.5555555555555p-1, m2_3)\
  entry(0.5, p1_2)                  \
  entry(-0.5, m1_2)                 \
  entry(1.5, p3_2)                  \
  entry(1.0, p1)                    \
  entry(-1.0, m1)                   \
  entry(2.0, p2)                    \
  entry(3.0, p3)
#define SL_POW_ALL(value, name) if (SL_FN(all)(y == (value))) return SL_FN(pow_##name)(x);
#define SL_POW_ANY(value, name) if (SL_FN(any)(y == (value))) r = SL_FN(select)(y == (value), SL_FN(pow_##name)(x), r);

/* pow where at least one lane may have a listed exponent. */
SL_LISTED_INLINE SL_F SL_FN(pow_listed)(SL_F x, SL_F y) {
  SL_F r;
  SL_POW_LIST(SL_POW_ALL)
  r = SL_FN(pow_general)(x, y);
  SL_POW_LIST(SL_POW_ANY)
  return r;
}
#undef SL_POW_ALL
#undef SL_POW_ANY

/* A listed exponent has nothing, or 0101...01, below the first bit of its fraction. */
static inline SL_F SL_FN(pow)(SL_F x, SL_F y) {
  SL_B low = SL_FN(bits)(y) << 13;
  if (SL_LIKELY(!SL_FN(any)((low == 0) | (low == UINT64_C(0xaaaaaaaaaaaaa000))))) return SL_FN(pow_general)(x, y);
  return SL_FN(pow_listed)(x, y);
}
#endif /* SL_FN */

#undef SL_F
#undef SL_B
#undef SL_M
#undef SL_FN
#undef SL_SCALAR
#undef SL_DEFINE_PATCH1
#undef SL_DEFINE_PATCH2
#undef SL_PATCH1
#undef SL_PATCH2
#undef SL_PATCH_REDUCE
#undef SL_LISTED_INLINE
