/*
 * sl_mathf.h - elementary functions in single precision that give the same bits everywhere.
 *
 * The float counterpart of sl_math.h, under the same rules: IEEE float +, -, *, /, sqrt,
 * comparisons and integer operations, nothing else. No double anywhere, no libm call, no state, no
 * FMA. Errors are below 2 ulp over the whole float range; special values are those of C99 Annex F.
 * Not reproducible: the sign and payload of a NaN. Not supported: flush-to-zero.
 */
#ifndef SL_MATHF_H
#define SL_MATHF_H

#include <float.h>
#include <stdint.h>

#ifdef __FAST_MATH__
#error "sl_mathf.h needs IEEE arithmetic: compile without -ffast-math"
#endif
#if FLT_RADIX != 2 || FLT_MANT_DIG != 24 || FLT_MIN_EXP != -125 || FLT_MAX_EXP != 128
#error "sl_mathf.h needs float to be the 32-bit IEEE format, and this compiler has another"
#endif
#if !defined(UINT32_MAX) || !defined(UINT64_MAX)
#error "sl_mathf.h needs uint32_t and uint64_t, which this compiler does not have"
#endif
/* 1: double, 2: long double, 64: double, negative: unknown; with 16 and 32 float arithmetic is
 * float */
#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 16 && \
    FLT_EVAL_METHOD != 32
#error "sl_mathf.h needs floats evaluated as float: on x86 -msse2 -mfpmath=sse, on s390x \
-fexcess-precision=fast"
#endif
typedef char slf_float_has_the_size_of_uint32_t[(sizeof(float) == sizeof(uint32_t)) ? 1 : -1];
#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

#if defined(__GNUC__)
#define SLF_LIKELY(c) __builtin_expect((c) != 0, 1)
#define SLF_RARE static __attribute__((noinline, cold, unused))
#else
#define SLF_LIKELY(c) (c)
#define SLF_RARE static
#endif

#define SLF_INF (slf_real(UINT32_C(0x7f800000)))
#define SLF_NAN (slf_real(UINT32_C(0x7fc00000)))
#define SLF_SIGN_BIT UINT32_C(0x80000000)
#define SLF_EXPONENT UINT32_C(0x7f800000)
/* keeps 12 significant bits: the product of two such is exact */
#define SLF_HIGH_12 UINT32_C(0xfffff000)
/* x + SLF_ROUND rounds x to an integer, held in the low bits */
#define SLF_ROUND 0x1.8p23f

typedef union {
  float real;
  uint32_t bits;
} slf_pun;

static inline uint32_t slf_bits(float x) {
  slf_pun u;
  u.real = x;
  return u.bits;
}

static inline float slf_real(uint32_t b) {
  slf_pun u;
  u.bits = b;
  return u.real;
}

static inline int slf_not(int m) { return !m; }
static inline float slf_if(int m, float a) { return m ? a : 0.0f; }
static inline float slf_true(int m) { return m ? 1.0f : 0.0f; }
static inline float slf_fmin(float a, float b) { return (a < b) ? a : b; }
static inline float slf_fmax(float a, float b) { return (a > b) ? a : b; }
static inline float slf_sq(float x) { return x * x; }
static inline float slf_fabs(float x) { return slf_real(slf_bits(x) & ~SLF_SIGN_BIT); }
static inline int slf_isfinite(float x) { return (slf_bits(x) & SLF_EXPONENT) != SLF_EXPONENT; }

static inline float slf_copysign(float x, float sign) {
  return slf_real((slf_bits(x) & ~SLF_SIGN_BIT) | (slf_bits(sign) & SLF_SIGN_BIT));
}

/* -1, 1, or x itself where x is a zero or NaN. */
static inline float slf_sign(float x) { return (x > 0.0f) ? 1.0f : (x < 0.0f) ? -1.0f : x; }

/* The correctly rounded root by integer arithmetic alone, digit by digit, for targets without a
 * square-root instruction. */
static inline float slf_sqrt_soft(float x) {
  uint32_t m = slf_bits(x), root = 0, twice = 0, digit;
  int e;
  if (!(x > 0.0f)) return (x == 0.0f) ? x : SLF_NAN;
  if (m >= SLF_EXPONENT) return x;
  e = (int)(m >> 23);
  if (e == 0) {
    for (; (m & (UINT32_C(1) << 23)) == 0; m <<= 1) e--;
    e++;
  }
  m = (m & ((UINT32_C(1) << 23) - 1)) | (UINT32_C(1) << 23);
  e -= 127;
  if ((e & 1) != 0) {
    m <<= 1;
    e--;
  }
  m <<= 1;
  for (digit = UINT32_C(1) << 24; digit != 0; digit >>= 1) {
    uint32_t trial = twice + digit;
    if (trial <= m) {
      twice = trial + digit;
      m -= trial;
      root += digit;
    }
    m <<= 1;
  }
  if (m != 0) root += root & 1; /* never a tie: the root of a 24-bit number has no 25-bit end */
  return slf_real((root >> 1) + ((uint32_t)((e / 2) + 126) << 23));
}

#if defined(SL_SOFT_SQRT)
static inline float slf_sqrt(float x) { return slf_sqrt_soft(x); }
#elif defined(__SSE__)
#include <xmmintrin.h>
static inline float slf_sqrt(float x) { return _mm_cvtss_f32(_mm_sqrt_ss(_mm_set_ss(x))); }
#elif defined(__aarch64__) && defined(__GNUC__)
static inline float slf_sqrt(float x) {
  float r;
  __asm__("fsqrt %s0, %s1" : "=w"(r) : "w"(x));
  return r;
}
#elif defined(__arm__) && defined(__ARM_FP) && (__ARM_FP & 4) && defined(__GNUC__)
static inline float slf_sqrt(float x) {
  float r;
  __asm__("vsqrt.f32 %0, %1" : "=t"(r) : "t"(x));
  return r;
}
#elif defined(__riscv_flen) && __riscv_flen >= 32 && defined(__GNUC__)
static inline float slf_sqrt(float x) {
  float r;
  __asm__("fsqrt.s %0, %1" : "=f"(r) : "f"(x));
  return r;
}
#elif defined(__wasm__) && defined(__GNUC__)
static inline float slf_sqrt(float x) { return __builtin_sqrtf(x); }
#else
static inline float slf_sqrt(float x) { return slf_sqrt_soft(x); }
#endif

/* x + 2^23 - 2^23 rounds |x| < 2^23 to the nearest integer; one comparison mends the direction. */
static inline float slf_floor(float x) {
  float shift = slf_copysign(0x1p23f, x), n = (x + shift) - shift;
  n = n - slf_if(n > x, 1.0f);
  return (slf_fabs(x) < 0x1p23f) ? slf_copysign(n, x) : x;
}

static inline float slf_ceil(float x) {
  float shift = slf_copysign(0x1p23f, x), n = (x + shift) - shift;
  n = n + slf_if(n < x, 1.0f);
  return (slf_fabs(x) < 0x1p23f) ? slf_copysign(n, x) : x;
}

SLF_RARE float slf_hypot_rare(float x, float y) {
  float a = slf_fabs(x), b = slf_fabs(y), s;
  if ((a == SLF_INF) || (b == SLF_INF)) return SLF_INF;
  if ((a != a) || (b != b)) return a + b;
  s = (slf_fmax(a, b) > 1.0f) ? 0x1p70f : 0x1p-70f;
  a /= s;
  b /= s;
  return slf_sqrt((a * a) + (b * b)) * s;
}

static inline float slf_hypot(float x, float y) {
  float q = (x * x) + (y * y);
  return SLF_LIKELY((q > 0x1p-90f) & (q < 0x1p120f)) ? slf_sqrt(q) : slf_hypot_rare(x, y);
}

/* ---- exp, expm1 ---------------------------------------------------------------------------------
 * hi + lo = k ln 2 + r with |r| <= ln 2 / 2.  exp(r) = 1 + a + b, where a is the exact leading part
 * of r and b holds what is left of r and r^2 P(r).  On return *t = k + SLF_ROUND. */
static inline void slf_exp_parts(float hi, float lo, float *t, float *a, float *b) {
  float n = (hi * 0x1.715476p+0f) + SLF_ROUND, k = n - SLF_ROUND;
  float rh = hi - (k * 0x1.62e4p-1f), rl = lo - (k * 0x1.7f7d1cp-20f);
  float r = rh + rl, r2 = r * r;
  float p =
      (0.5f + (r * 0x1.555556p-3f)) + (r2 * ((0x1.5554e4p-5f + (r * 0x1.1110ep-7f)) +
                                             (r2 * (0x1.6d492p-10f + (r * 0x1.a12a42p-13f)))));
  *t = n;
  *a = rh;
  *b = rl + (r2 * p);
}

/* exp(hi + lo) for |hi| < 87, where the exponent can be added to the bits. */
static inline float slf_exp_sum(float hi, float lo) {
  float t, a, b;
  slf_exp_parts(hi, lo, &t, &a, &b);
  return slf_real(slf_bits(1.0f + (a + b)) + (slf_bits(t) << 23));
}

/* exp(hi + lo) for every finite hi: overflow, denormal results. */
static inline float slf_exp_sum_rare(float hi, float lo) {
  float t, a, b;
  int k, half;
  if (hi > 89.0f) return SLF_INF;
  if (hi < -104.0f) return 0.0f;
  slf_exp_parts(hi, lo, &t, &a, &b);
  k = (int)(t - SLF_ROUND);
  half = k / 2;
  return (1.0f + (a + b)) * slf_real((uint32_t)(half + 127) << 23) *
         slf_real((uint32_t)(k - half + 127) << 23);
}

SLF_RARE float slf_exp_rare(float x) { return (x != x) ? x : slf_exp_sum_rare(x, 0.0f); }
SLF_RARE float slf_expm1_rare(float x) {
  return (x != x) ? x : (x < 0.0f) ? -1.0f : slf_exp_sum_rare(x, 0.0f);
}

static inline float slf_exp(float x) {
  return SLF_LIKELY(slf_fabs(x) < 87.0f) ? slf_exp_sum(x, 0.0f) : slf_exp_rare(x);
}

static inline float slf_expm1(float x) {
  float t, a, b, s;
  if (!SLF_LIKELY(slf_fabs(x) < 87.0f)) return slf_expm1_rare(x);
  slf_exp_parts(x, 0.0f, &t, &a, &b);
  s = slf_real((slf_bits(t) << 23) + UINT32_C(0x3f800000));
  return slf_copysign(((s - 1.0f) + (s * a)) + (s * b), x);
}

/* ---- log, log1p ---------------------------------------------------------------------------------
 * x = 2^k m with m in [sqrt(1/2), sqrt(2)), f = m - 1, s = f / (2 + f), log m = 2 atanh s. */
#define SLF_SQRT_HALF UINT32_C(0x3f3504f3)

/* k ln 2 + log(1 + f) + lo */
static inline float slf_log_sum(float k, float f, float lo) {
  float s = f / (2.0f + f), z = s * s, half = 0.5f * f * f;
  float p =
      (0x1.555556p-1f + (z * 0x1.9999ecp-2f)) + ((z * z) * (0x1.245c44p-2f + (z * 0x1.ddcedp-3f)));
  return (k * 0x1.62e4p-1f) -
         ((half - ((s * (half + (z * p))) + ((k * 0x1.7f7d1cp-20f) + lo))) - f);
}

/* What the exponent field of the shifted bits counts, of an x that was multiplied by 2^scaled. */
static inline float slf_exponent(uint32_t shifted, int scaled) {
  /* the field's sign bit, folded by hand */
  return (float)((int)((shifted >> 23) ^ 0x100u) - (0x100 + scaled));
}

static inline float slf_log_of(float x, int scaled) {
  uint32_t b = slf_bits(x), shifted = b - SLF_SQRT_HALF;
  return slf_log_sum(slf_exponent(shifted, scaled),
                     slf_real(b - (shifted & UINT32_C(0xff800000))) - 1.0f, 0.0f);
}

SLF_RARE float slf_log_rare(float x) {
  if ((x != x) || (x == SLF_INF)) return x;
  if (x == 0.0f) return -SLF_INF;
  if (x < 0.0f) return SLF_NAN;
  return slf_log_of(x * 0x1p25f, 25);
}

static inline float slf_log(float x) {
  return SLF_LIKELY((x >= FLT_MIN) & (x <= FLT_MAX)) ? slf_log_of(x, 0) : slf_log_rare(x);
}

SLF_RARE float slf_log1p_rare(float x) { return (x > 1.0f) ? slf_log(x) : slf_log_rare(1.0f + x); }

/* 1 + x = u + c exactly; c goes where it still counts: into f, and what f cannot hold to first
 * order behind it. */
static inline float slf_log1p(float x) {
  float u = 1.0f + x, v = u - 1.0f, c = (1.0f - (u - v)) + (x - v), m, d, f, lost;
  uint32_t b = slf_bits(u), shifted = b - SLF_SQRT_HALF, kk = shifted & UINT32_C(0xff800000);
  if (!SLF_LIKELY((x > -1.0f) & (x < 0x1p100f))) return slf_log1p_rare(x);
  m = slf_real(b - kk) - 1.0f;
  d = c * slf_real(UINT32_C(0x3f800000) - kk);
  f = m + d;
  lost = (m - f) + d;
  return slf_copysign(slf_log_sum(slf_exponent(shifted, 0), f, lost * (1.0f - f + (f * f))), x);
}

/* ---- sin, cos, tan ------------------------------------------------------------------------------
 * x = n pi/2 + r, |r| <= pi/4, r as hi + lo; three 11-bit pieces of pi/2 make n times each exact
 * for |x| < 2^13. */

/* Payne and Hanek: the bits of x 2/pi around the binary point, from the bits of 2/pi that matter;
 * |x| >= 2^13. Returns n mod 4 and r = hi + lo; hi is NaN for an infinite or NaN x. */
SLF_RARE uint32_t slf_reduce_rare(float x, float *hi, float *lo) {
  static const uint32_t two_over_pi[8] = {
      UINT32_C(0),          UINT32_C(0xa2f9836e), UINT32_C(0x4e441529), UINT32_C(0xfc2757d1),
      UINT32_C(0xf534ddc0), UINT32_C(0xdb629599), UINT32_C(0x3c439041), UINT32_C(0xfe5163ab)};
  uint32_t b = slf_bits(x), m = (b & UINT32_C(0x7fffff)) | UINT32_C(0x800000), t[3], n, sign = 0;
  int e = (int)((b & SLF_EXPONENT) >> 23), first = e - 150 - 2 + 32, i, shift;
  uint64_t low, mid, p;
  *lo = 0.0f;
  if (e == 255) {
    *hi = SLF_NAN;
    return 0;
  }
  /* 96 bits of 2/pi; those before them weigh multiples of 4 quarters of a turn */
  for (i = 0; i < 3; i++) {
    int word = (first / 32) + i, bit = first % 32;
    t[i] = (bit == 0) ? two_over_pi[word]
                      : ((two_over_pi[word] << bit) | (two_over_pi[word + 1] >> (32 - bit)));
  }
  low = (uint64_t)m * t[2];
  mid = ((uint64_t)m * t[1]) + (low >> 32);
  p = ((uint64_t)(uint32_t)((m * t[0]) + (uint32_t)(mid >> 32)) << 32) | (uint32_t)mid;
  n = (uint32_t)(p >> 62);
  p = (p << 2) | ((uint32_t)low >> 30);
  if ((p >> 63) != 0) { /* beyond the half: take the next quarter, go back */
    n++;
    sign = SLF_SIGN_BIT;
    p = ~p;
  }
  for (shift = 0; ((p >> 63) == 0) && (shift < 40); shift++) p <<= 1;
  p = (p >> 32) * UINT64_C(0xc90fdaa2); /* pi/2 in units of 2^-31 */
  *hi = slf_real(slf_bits((float)(uint32_t)(p >> 40) * slf_real((uint32_t)(104 - shift) << 23)) ^
                 sign);
  *lo = slf_real(slf_bits((float)((uint32_t)(p >> 16) & UINT32_C(0xffffff)) *
                          slf_real((uint32_t)(80 - shift) << 23)) ^
                 sign);
  if ((b & SLF_SIGN_BIT) != 0) {
    *hi = -*hi;
    *lo = -*lo;
    n = 0 - n;
  }
  return n;
}

/* n in the low bits of the result; r = *hi + *lo */
static inline uint32_t slf_reduce(float x, float *hi, float *lo) {
  float t, n, a, b, c, d, e, f;
  if (!SLF_LIKELY(slf_fabs(x) < 0x1p13f)) return slf_reduce_rare(x, hi, lo);
  t = (x * 0x1.45f306p-1f) + SLF_ROUND;
  n = t - SLF_ROUND;
  a = x - (n * 0x1.92p+0f);
  b = n * 0x1.fb4p-12f;
  c = a - b;
  d = (a - c) - b;
  e = n * 0x1.444p-24f;
  f = c - e;
  *hi = f;
  *lo = ((c - f) - e) + (d - (n * 0x1.68c234p-39f));
  return slf_bits(t);
}

/* Sine and cosine of r + y, |r| <= pi/4, and in *s_lo and *c_lo what their last roundings left
 * over. */
static inline void slf_sincos_parts(float r, float y, float *s, float *s_lo, float *c,
                                    float *c_lo) {
  float z = r * r, half = 0.5f * z, one = 1.0f - half, ds, dc;
  ds = (-0x1.555556p-3f + (z * 0x1.11110ep-7f)) +
       ((z * z) * (-0x1.a013a2p-13f + (z * 0x1.6dbbeep-19f)));
  ds = ((half * y) - y) - ((z * r) * ds);
  *s = r - ds;
  *s_lo = (r - *s) - ds;
  dc = (0x1.555554p-5f + (z * -0x1.6c12cep-10f)) + ((z * z) * 0x1.9bd67p-16f);
  dc = ((1.0f - one) - half) + (((z * z) * dc) - (r * y));
  *c = one + dc;
  *c_lo = (one - *c) + dc;
}

static inline void slf_sincos(float x, float *sine, float *cosine) {
  float r, y, s, c, s_lo, c_lo;
  uint32_t n = slf_reduce(x, &r, &y);
  slf_sincos_parts(r, y, &s, &s_lo, &c, &c_lo);
  *sine = slf_real(slf_bits(((n & 1) != 0) ? c : s) ^ ((n << 30) & SLF_SIGN_BIT));
  *cosine = slf_real(slf_bits(((n & 1) != 0) ? s : c) ^ (((n + 1) << 30) & SLF_SIGN_BIT));
}

static inline float slf_sin(float x) {
  float s, c;
  slf_sincos(x, &s, &c);
  return s;
}

static inline float slf_cos(float x) {
  float s, c;
  slf_sincos(x, &s, &c);
  return c;
}

/* The quotient of sine and cosine, or -1 over it, mended to first order by what they left over. */
static inline float slf_tan(float x) {
  float r, y, s, c, s_lo, c_lo, q;
  uint32_t n = slf_reduce(x, &r, &y);
  if (x == 0.0f) return x;
  slf_sincos_parts(r, y, &s, &s_lo, &c, &c_lo);
  if ((n & 1) != 0) {
    q = c / s;
    return -(q + ((c_lo - (q * s_lo)) / s));
  }
  q = s / c;
  return q + ((s_lo - (q * c_lo)) / c);
}

/* ---- the cube-root family -----------------------------------------------------------------------
 * y ~ x^(-1/3) from the bits of x divided by -3, one step of third order, then rounded to 8 bits so
 * that y^3 is exact: x^(-1/3) = y (1 + d) with d from h = 1 - x y^3. */
static inline float slf_rcbrt_parts(float x, float *d) {
  float y = slf_real(UINT32_C(0x54a2fa8c) - (slf_bits(x) / 3)), h = 1.0f - (x * (y * y * y));
  y = y + ((y * h) * (0x1.555556p-2f + (h * 0x1.c71c72p-3f)));
  y = slf_real((slf_bits(y) + UINT32_C(0x8000)) & UINT32_C(0xffff0000));
  h = 1.0f - (x * (y * y * y));
  *d = h * ((0x1.555556p-2f + (h * 0x1.c71c72p-3f)) + ((h * h) * 0x1.61f9aep-3f));
  return y;
}

/* x^(-1/3), x^(-2/3) = y^2 (1 + d)^2, x^(1/3) = x y^2 (1 + d)^2, x^(2/3) = x y (1 + d): the leading
 * products are exact, x cut to 8 or 16 bits for that, and the small rest is added last. */
static inline float slf_m1_3_sum(float x) {
  float d, y = slf_rcbrt_parts(x, &d);
  return y + (y * d);
}

static inline float slf_m2_3_sum(float x) {
  float d, y = slf_rcbrt_parts(x, &d), y2 = y * y;
  return y2 + (y2 * (d + d + (d * d)));
}

static inline float slf_p1_3_sum(float x) {
  float d, y = slf_rcbrt_parts(x, &d), y2 = y * y,
           xh = slf_real(slf_bits(x) & UINT32_C(0xffff0000));
  return (xh * y2) + (((x - xh) * y2) + ((x * y2) * (d + d + (d * d))));
}

static inline float slf_p2_3_sum(float x) {
  float d, y = slf_rcbrt_parts(x, &d), xh = slf_real(slf_bits(x) & UINT32_C(0xffffff00));
  return (xh * y) + (((x - xh) * y) + ((x * y) * d));
}

/* x^(thirds/3) of what the fast path leaves out: zeros, infinities, NaN, negative, very small and
 * very large x. */
SLF_RARE float slf_thirds_rare(float x, int thirds) {
  float to, unit; /* x is multiplied by `to` = 2^(-+60), the result by unit^thirds */
  if (x != x) return x;
  if ((x == 0.0f) || (slf_fabs(x) == SLF_INF)) {
    return ((x == 0.0f) == (thirds > 0)) ? 0.0f : SLF_INF;
  }
  if (x < 0.0f) return SLF_NAN;
  to = (x < 1.0f) ? 0x1p60f : 0x1p-60f;
  unit = (x < 1.0f) ? 0x1p-20f : 0x1p20f;
  switch (thirds) {
    case 1: return slf_p1_3_sum(x * to) * unit;
    case 2: return slf_p2_3_sum(x * to) * (unit * unit);
    case -1: return slf_m1_3_sum(x * to) / unit;
    default: return slf_m2_3_sum(x * to) / (unit * unit);
  }
}

static inline int slf_thirds_usual(float x) { return (x > 0x1p-100f) & (x < 0x1p100f); }
static inline float slf_pow_p1_3(float x) {
  return slf_thirds_usual(x) ? slf_p1_3_sum(x) : slf_thirds_rare(x, 1);
}
static inline float slf_pow_p2_3(float x) {
  return slf_thirds_usual(x) ? slf_p2_3_sum(x) : slf_thirds_rare(x, 2);
}
static inline float slf_pow_m1_3(float x) {
  return slf_thirds_usual(x) ? slf_m1_3_sum(x) : slf_thirds_rare(x, -1);
}
static inline float slf_pow_m2_3(float x) {
  return slf_thirds_usual(x) ? slf_m2_3_sum(x) : slf_thirds_rare(x, -2);
}

/* ---- pow ----------------------------------------------------------------------------------------
 * Exponents with a kernel of their own.  pow(-0, 1/2) = +0, pow(-inf, 1/2) = +inf, unlike sqrt. */
static inline float slf_pow_p1_2(float x) {
  return (x == -SLF_INF) ? SLF_INF : (slf_sqrt(x) + 0.0f);
}
static inline float slf_pow_m1_2(float x) { return 1.0f / slf_pow_p1_2(x); }
static inline float slf_pow_p3_2(float x) { return (x == -SLF_INF) ? SLF_INF : (x * slf_sqrt(x)); }
static inline float slf_pow_p1(float x) { return x; }
static inline float slf_pow_m1(float x) { return 1.0f / x; }
static inline float slf_pow_p2(float x) { return x * x; }
static inline float slf_pow_p3(float x) { return x * x * x; }

/* (*hi + *lo) = y log x, about 2^-33 relative, for normal positive x that was multiplied by
 * 2^scaled. x = 2^k m, m / c near 1 with c one of four short numbers whose logarithm is known as a
 * sum of two floats; s = (m - c) / (m + c) as sh + sl, log m = log c + 2 atanh s. */
static inline void slf_pow_log(float x, float y, int scaled, float *hi, float *lo) {
  static const float short_c[4] = {1.0f, 0x1.2dp+0f, 0x1.728p+0f, 0x1.b3p+0f};
  static const float log_high[4] = {0.0f, 0x1.4ba37p-3f, 0x1.7a8c58p-2f, 0x1.0f7242p-1f};
  static const float log_low[4] = {0.0f, -0x1.8cb544p-28f, 0x1.b37d52p-28f, -0x1.b25b42p-28f};
  uint32_t b = slf_bits(x), shifted = b - UINT32_C(0x3f6ac000), quarter = (shifted >> 21) & 3;
  float k = slf_exponent(shifted, scaled), m = slf_real(b - (shifted & UINT32_C(0xff800000)));
  float c = short_c[quarter], f = m - c, u = m + c, v = 1.0f / u, s = f * v;
  float sh = slf_real(slf_bits(s) & SLF_HIGH_12), uh = slf_real(slf_bits(u) & SLF_HIGH_12);
  float sl = ((f - (sh * uh)) - (sh * (m - (uh - c)))) * v;
  float ds = (sh - s) + sl; /* s + ds is the better s */
  float z = s * s, p = 0x1.555556p-1f + (z * (0x1.999956p-2f + (z * 0x1.258bfap-2f)));
  float kl = k * 0x1.62e4p-1f, t = kl + log_high[quarter], tl = (kl - t) + log_high[quarter];
  float sh2 = sh + sh, h = t + sh2;
  float rest = (tl + ((k * 0x1.7f7d1cp-20f) + log_low[quarter])) + ((sl + sl) + ((z + z) * ds));
  float l = (((t - h) + sh2) + rest) + ((s * z) * p);
  float lh = slf_real(slf_bits(h + l) & SLF_HIGH_12), ll = (h - lh) + l;
  float yh = slf_real(slf_bits(y) & SLF_HIGH_12);
  *hi = yh * lh;
  *lo = (y * ll) + ((y - yh) * lh);
}

/* 0: not an integer, 1: odd, 2: even */
static inline int slf_parity(float y) {
  float a = slf_fabs(y), h = 0.5f * a;
  if (a >= 0x1p24f) return 2;
  if (slf_floor(a) != a) return 0;
  return (slf_floor(h) == h) ? 2 : 1;
}

/* C99 Annex F.9.4.4 in its order, then the general case with every scaling. */
SLF_RARE float slf_pow_rare(float x, float y) {
  float a = slf_fabs(x), hi, lo, r;
  int parity, scaled = 0;
  if ((y == 0.0f) || (x == 1.0f)) return 1.0f;
  if ((x != x) || (y != y)) return x + y;
  if (slf_fabs(y) == SLF_INF) {
    return (a == 1.0f) ? 1.0f : ((a > 1.0f) == (y > 0.0f)) ? SLF_INF : 0.0f;
  }
  parity = slf_parity(y);
  if ((a == 0.0f) || (a == SLF_INF)) {
    r = ((a == 0.0f) == (y > 0.0f)) ? 0.0f : SLF_INF;
  } else {
    if ((x < 0.0f) && (parity == 0)) return SLF_NAN;
    if (a < FLT_MIN) {
      a *= 0x1p25f;
      scaled = 25;
    }
    slf_pow_log(a, y, scaled, &hi, &lo);
    r = slf_exp_sum_rare(hi, lo);
  }
  return (parity == 1) ? slf_copysign(r, x) : r;
}

static inline float slf_pow_general(float x, float y) {
  float hi, lo;
  if (!SLF_LIKELY((x >= FLT_MIN) & (x <= FLT_MAX))) return slf_pow_rare(x, y);
  slf_pow_log(x, y, 0, &hi, &lo);
  return SLF_LIKELY(slf_fabs(hi) < 87.0f) ? slf_exp_sum(hi, lo) : slf_pow_rare(x, y);
}

/* pow; at these exponents it is by definition the kernel of that name (1/3 and 2/3 are the nearest
 * floats). */
static inline float slf_pow(float x, float y) {
  if (y == 0x1.555556p-2f) return slf_pow_p1_3(x);
  if (y == -0x1.555556p-2f) return slf_pow_m1_3(x);
  if (y == 0x1.555556p-1f) return slf_pow_p2_3(x);
  if (y == -0x1.555556p-1f) return slf_pow_m2_3(x);
  if (y == 0.5f) return slf_pow_p1_2(x);
  if (y == -0.5f) return slf_pow_m1_2(x);
  if (y == 1.5f) return slf_pow_p3_2(x);
  if (y == 1.0f) return x;
  if (y == -1.0f) return 1.0f / x;
  if (y == 2.0f) return x * x;
  if (y == 3.0f) return x * x * x;
  return slf_pow_general(x, y);
}

#endif /* SL_MATHF_H */
