/*
 * sl_lanes.h - sl_math.h on SL_W doubles at once, lane by lane the same bits.
 *
 * sl_v is a vector of SL_W doubles (GCC/Clang vector extension; SL_W = 1 is plain double), sl_b its
 * bits, sl_m a mask as comparisons make it.  Arithmetic and comparisons are written with operators;
 * slv_name() are the functions of sl_math.h, from the same source.  Intrinsics appear only where
 * the extensions lose speed (blend, root, minimum, "any lane"), and never change a bit.
 */
#ifndef SL_LANES_H
#define SL_LANES_H

#include "sl_math.h"

#ifndef SL_W
#if defined(__AVX512F__) && defined(__AVX512DQ__)
#define SL_W 8
#elif defined(__AVX__)
#define SL_W 4
#elif defined(__SSE2__) || defined(__aarch64__)
#define SL_W 2
#else
#define SL_W 1
#endif
#endif

#if SL_W == 1

typedef double sl_v;
typedef uint64_t sl_b;
typedef int sl_m;

#define slv_bits sl_bits
#define slv_real sl_real
#define slv_set sl_set
#define slv_select sl_select
#define slv_if sl_if
#define slv_true sl_true
#define slv_not sl_not
#define slv_any sl_any
#define slv_all sl_all
#define slv_pick sl_pick
#define slv_below sl_below
#define slv_fmin sl_fmin
#define slv_fmax sl_fmax
#define slv_sqrt sl_sqrt
#define SL_LANE(v, lane) (*(&(v) + (lane)))
#define SL_EACH(x) x

#elif SL_W == 2 || SL_W == 4 || SL_W == 8 || SL_W == 16

/* vectors are passed between static functions of one file only */
#pragma GCC diagnostic ignored "-Wpsabi"

typedef double sl_v __attribute__((vector_size(8 * SL_W)));
typedef uint64_t sl_b __attribute__((vector_size(8 * SL_W)));
typedef __typeof__((sl_v){0} < (sl_v){0}) sl_m;
#define SL_LANE(v, lane) ((v)[lane])
/* an initialiser: x in all lanes */
#if SL_W == 2
#define SL_EACH(x) {x, x}
#define SL_EACH_TWO(x, y) {x, y}
#elif SL_W == 4
#define SL_EACH(x) {x, x, x, x}
#define SL_EACH_TWO(x, y) {x, y, x, y}
#elif SL_W == 8
#define SL_EACH(x) {x, x, x, x, x, x, x, x}
#else
#define SL_EACH(x) {x, x, x, x, x, x, x, x, x, x, x, x, x, x, x, x}
#endif

/* The machine's own vector, SL_NATIVE doubles; an sl_v is SL_W / SL_NATIVE of them. */
#if defined(__AVX512F__) && defined(__AVX512DQ__) && SL_W >= 8
#include <immintrin.h>
#define SL_NATIVE 8
typedef __m512d sl_native;
#define SL_NATIVE_SELECT(m, a, b) \
  _mm512_castsi512_pd(_mm512_ternarylogic_epi64(_mm512_castpd_si512(m), _mm512_castpd_si512(a), \
                                                _mm512_castpd_si512(b), 0xca /* m ? a : b */))
#define SL_NATIVE_PICK(at, a, b) \
  _mm512_mask_blend_pd(_mm512_movepi64_mask(_mm512_castpd_si512(at)), a, b)
#define SL_NATIVE_TOPS(m) ((unsigned)_mm512_movepi64_mask(_mm512_castpd_si512(m)))
#define SL_NATIVE_MIN _mm512_min_pd
#define SL_NATIVE_MAX _mm512_max_pd
#define SL_NATIVE_SQRT _mm512_sqrt_pd
#elif defined(__AVX__) && SL_W >= 4
#include <immintrin.h>
#define SL_NATIVE 4
typedef __m256d sl_native;
#define SL_NATIVE_SELECT(m, a, b) _mm256_blendv_pd(b, a, m)
#define SL_NATIVE_PICK(at, a, b) _mm256_blendv_pd(a, b, at)
#define SL_NATIVE_TOPS(m) ((unsigned)_mm256_movemask_pd(m))
#define SL_NATIVE_MIN _mm256_min_pd
#define SL_NATIVE_MAX _mm256_max_pd
#define SL_NATIVE_SQRT _mm256_sqrt_pd
#elif defined(__SSE2__)
#include <emmintrin.h>
#define SL_NATIVE 2
typedef __m128d sl_native;
#if defined(__SSE4_1__)
#include <smmintrin.h>
#define SL_NATIVE_SELECT(m, a, b) _mm_blendv_pd(b, a, m)
#define SL_NATIVE_PICK(at, a, b) _mm_blendv_pd(a, b, at)
#else
#define SL_NATIVE_SELECT(m, a, b) _mm_or_pd(_mm_and_pd(m, a), _mm_andnot_pd(m, b))
#endif
#define SL_NATIVE_TOPS(m) ((unsigned)_mm_movemask_pd(m))
#define SL_NATIVE_MIN _mm_min_pd
#define SL_NATIVE_MAX _mm_max_pd
#define SL_NATIVE_SQRT _mm_sqrt_pd
#elif defined(__aarch64__)
#include <arm_neon.h>
#define SL_NATIVE 2
typedef float64x2_t sl_native;
#define SL_NATIVE_SELECT(m, a, b) vbslq_f64(vreinterpretq_u64_f64(m), a, b)
#define SL_NATIVE_SQRT vsqrtq_f64
#endif

#ifdef SL_NATIVE
typedef union {
  sl_v all;
  sl_b bits;
  sl_m mask;
  sl_native part[SL_W / SL_NATIVE];
} sl_parts;
#define SL_EACH_PART for (int part = 0; part < SL_W / SL_NATIVE; part++)
#endif

static inline sl_b slv_bits(sl_v x) { return (sl_b)x; }
static inline sl_v slv_real(sl_b b) { return (sl_v)b; }
static inline sl_v slv_set(double x) { return x - (sl_v){0}; } /* -0 - 0 is -0 */
static inline sl_m slv_not(sl_m m) { return ~m; }
static inline sl_v slv_if(sl_m m, sl_v a) { return (sl_v)((sl_b)m & (sl_b)a); }
static inline sl_v slv_true(sl_m m) { return slv_if(m, slv_set(1.0)); }

#ifdef SL_NATIVE_SELECT
static inline sl_v slv_select(sl_m m, sl_v a, sl_v b) {
  sl_parts pm, pa, pb;
  pm.mask = m;
  pa.all = a;
  pb.all = b;
  SL_EACH_PART pa.part[part] = SL_NATIVE_SELECT(pm.part[part], pa.part[part], pb.part[part]);
  return pa.all;
}
#else
static inline sl_v slv_select(sl_m m, sl_v a, sl_v b) {
  return (sl_v)(((sl_b)m & (sl_b)a) | (~(sl_b)m & (sl_b)b));
}
#endif

/* b where the top bit of `at` is set, else a */
#ifdef SL_NATIVE_PICK
static inline sl_v slv_pick(sl_b at, sl_v a, sl_v b) {
  sl_parts p, pa, pb;
  p.bits = at;
  pa.all = a;
  pb.all = b;
  SL_EACH_PART pa.part[part] = SL_NATIVE_PICK(p.part[part], pa.part[part], pb.part[part]);
  return pa.all;
}
#else
static inline sl_v slv_pick(sl_b at, sl_v a, sl_v b) { return slv_select((sl_m)at < 0, b, a); }
#endif

/* a < limit, unsigned; with the top bits turned it is a signed comparison, which AVX2 has */
static inline sl_m slv_below(sl_b a, uint64_t limit) {
  return (sl_m)(a + SL_SIGN_BIT) < (sl_m)((sl_b){0} + (limit + SL_SIGN_BIT));
}

#ifdef SL_NATIVE_TOPS
static inline int slv_any(sl_m m) {
  sl_parts p;
  unsigned tops = 0;
  p.mask = m;
  SL_EACH_PART tops |= SL_NATIVE_TOPS(p.part[part]);
  return tops != 0;
}
static inline int slv_all(sl_m m) {
  sl_parts p;
  unsigned tops = (1u << SL_NATIVE) - 1;
  p.mask = m;
  SL_EACH_PART tops &= SL_NATIVE_TOPS(p.part[part]);
  return tops == (1u << SL_NATIVE) - 1;
}
#else
static inline int slv_any(sl_m m) {
  int64_t some = 0;
  for (int lane = 0; lane < SL_W; lane++) some |= m[lane];
  return some != 0;
}
static inline int slv_all(sl_m m) {
  int64_t every = -1;
  for (int lane = 0; lane < SL_W; lane++) every &= m[lane];
  return every != 0;
}
#endif

#ifdef SL_NATIVE_MIN /* x86's minpd(a, b) is a < b ? a : b, also for NaN and zeros */
static inline sl_v slv_fmin(sl_v a, sl_v b) {
  sl_parts pa, pb;
  pa.all = a;
  pb.all = b;
  SL_EACH_PART pa.part[part] = SL_NATIVE_MIN(pa.part[part], pb.part[part]);
  return pa.all;
}
static inline sl_v slv_fmax(sl_v a, sl_v b) {
  sl_parts pa, pb;
  pa.all = a;
  pb.all = b;
  SL_EACH_PART pa.part[part] = SL_NATIVE_MAX(pa.part[part], pb.part[part]);
  return pa.all;
}
#else
static inline sl_v slv_fmin(sl_v a, sl_v b) { return slv_select(a < b, a, b); }
static inline sl_v slv_fmax(sl_v a, sl_v b) { return slv_select(a > b, a, b); }
#endif

#if defined(SL_NATIVE_SQRT) && !defined(SL_SOFT_SQRT)
static inline sl_v slv_sqrt(sl_v x) {
  sl_parts p;
  p.all = x;
  SL_EACH_PART p.part[part] = SL_NATIVE_SQRT(p.part[part]);
  return p.all;
}
#else
static inline sl_v slv_sqrt(sl_v x) {
  for (int lane = 0; lane < SL_W; lane++) x[lane] = sl_sqrt(x[lane]);
  return x;
}
#endif

#else
#error "SL_W must be 1, 2, 4, 8 or 16"
#endif /* SL_W */

/* A product of words of 32 bits in lanes of 64. GCC multiplies all 64 bits, in three products and
 * their sums; Clang sees that there are no more than 32. */
#if defined(__has_builtin) && !defined(__clang__)
#if SL_W == 8 && defined(__AVX512F__)
#if __has_builtin(__builtin_ia32_pmuludq512_mask)
#define SL_HALVES(x) ((int __attribute__((vector_size(64))))(x))
#define SL_WHOLES(x) ((long long __attribute__((vector_size(64))))(x))
#define slv_word_product(a, b) \
  ((sl_b)__builtin_ia32_pmuludq512_mask(SL_HALVES(a), SL_HALVES(b), SL_WHOLES(a), 255))
#endif
#elif SL_W == 4 && defined(__AVX2__)
#if __has_builtin(__builtin_ia32_pmuludq256)
#define SL_HALVES(x) ((int __attribute__((vector_size(32))))(x))
#define slv_word_product(a, b) ((sl_b)__builtin_ia32_pmuludq256(SL_HALVES(a), SL_HALVES(b)))
#endif
#elif SL_W == 2 && defined(__SSE2__)
#if __has_builtin(__builtin_ia32_pmuludq128)
#define SL_HALVES(x) ((int __attribute__((vector_size(16))))(x))
#define slv_word_product(a, b) ((sl_b)__builtin_ia32_pmuludq128(SL_HALVES(a), SL_HALVES(b)))
#endif
#endif
#endif
#ifndef slv_word_product
#define slv_word_product(a, b) ((a) * (b))
#endif

/* Of two lanes each: lane i of a, and lane j of b. */
#ifdef __clang__
#define SL_SHUFFLE(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#define SL_SHUFFLE(a, b, ...) __builtin_shuffle(a, b, (sl_b){__VA_ARGS__})
#endif
#if SL_W == 2
#define slv_pair(a, i, b, j) SL_SHUFFLE(a, b, i, 2 + j)
#elif SL_W == 4
#define slv_pair(a, i, b, j) SL_SHUFFLE(a, b, i, 4 + j, 2 + i, 6 + j)
#endif
#define slv_pair_masks(a, i, b, j) ((sl_m)slv_pair((sl_v)(a), i, (sl_v)(b), j))

/* Lanes 0 .. SL_W - 1 from and to consecutive doubles; no alignment is asked. */
static inline sl_v slv_load(const double *from) {
  sl_v x = slv_set(0.0);
  for (int lane = 0; lane < SL_W; lane++) SL_LANE(x, lane) = from[lane];
  return x;
}
static inline void slv_store(double *to, sl_v x) {
  for (int lane = 0; lane < SL_W; lane++) to[lane] = SL_LANE(x, lane);
}
static inline double slv_get(sl_v x, int lane) { return SL_LANE(x, lane); }
static inline sl_v slv_put(sl_v x, int lane, double value) {
  SL_LANE(x, lane) = value;
  return x;
}

/*
 * slv_name(x): complete.  Rare lanes leave the fast path through a branch, out of line and through
 * memory, so that the fast path keeps its registers.
 */
#define SL_F sl_v
#define SL_B sl_b
#define SL_M sl_m
#define SL_FN(name) slv_##name
#define SL_CHECKED(name) slv_##name
#define SL_OK
#define SL_PASS_OK
#define SL_CORES
#define SL_POW_INLINE static __attribute__((noinline, unused))
#define SL_DEFINE_PATCH1(name)                                                   \
  SL_RARE void slv_##name(sl_v *r, const sl_v *x, const sl_m *ok) {              \
    for (int lane = 0; lane < SL_W; lane++)                                      \
      if (!SL_LANE(*ok, lane)) SL_LANE(*r, lane) = sl_##name(SL_LANE(*x, lane)); \
  }
#define SL_DEFINE_PATCH2(name)                                                     \
  SL_RARE void slv_##name(sl_v *r, const sl_v *x, const sl_v *y, const sl_m *ok) { \
    for (int lane = 0; lane < SL_W; lane++)                                        \
      if (!SL_LANE(*ok, lane))                                                     \
        SL_LANE(*r, lane) = sl_##name(SL_LANE(*x, lane), SL_LANE(*y, lane));       \
  }
#define SL_PATCH1(ok, r, name, x)           \
  do {                                      \
    const sl_m ok_ = (ok);                  \
    if (!SL_LIKELY(slv_all(ok_))) {         \
      sl_v r_ = (r), x_ = (x);              \
      sl_m m_ = ok_;                        \
      slv_##name(&r_, &x_, &m_);            \
      (r) = r_;                             \
    }                                       \
  } while (0)
#define SL_PATCH2(ok, r, name, x, y)        \
  do {                                      \
    const sl_m ok_ = (ok);                  \
    if (!SL_LIKELY(slv_all(ok_))) {         \
      sl_v r_ = (r), x_ = (x), y_ = (y);    \
      sl_m m_ = ok_;                        \
      slv_##name(&r_, &x_, &y_, &m_);       \
      (r) = r_;                             \
    }                                       \
  } while (0)

#include "sl_math.h"

/*
 * slv_name_fast(x, &ok): the same without any branch, so that a whole evaluation is one block for
 * the compiler to schedule.  Lanes that slv_name(x) would have patched are cleared in ok, their
 * result is meaningless: start with ok = slv_yes() and, unless slv_all(ok), evaluate again with
 * slv_name.  Where ok stays set the bits are the same.
 */
static inline sl_m slv_yes(void) { return slv_set(0.0) == 0.0; }

#define SL_F sl_v
#define SL_B sl_b
#define SL_M sl_m
#define SL_FN(name) slv_##name
#define SL_CHECKED(name) slv_##name##_fast
#define SL_OK , sl_m *ok
#define SL_PASS_OK , ok
#define SL_PATCH1(fine, r, name, x) (*ok &= (fine))
#define SL_PATCH2(fine, r, name, x, y) (*ok &= (fine))

#include "sl_math.h"

#endif /* SL_LANES_H */
