/*
 * sl_noise.h - random numbers that are no state: they follow from what is counted, wherever and in
 * whatever order they are made.
 *
 * Words are those of Philox4x32-10: J. K. Salmon, M. A. Moraes, R. O. Dror and D. E. Shaw,
 * "Parallel random numbers: as easy as 1, 2, 3", SC'11 (2011), doi 10.1145/2063384.2063405. Normal
 * numbers are made of them by Box and Muller's method (Ann. Math. Statist. 29 (1958), 610), with
 * our own elementary functions: the same bits everywhere.
 *
 * It makes them for SL_W runs at once behind sl_lanes.h, for one in double behind sl_math.h, and
 * for one in float behind sl_mathf.h where SL_NOISE_SINGLE is defined. One file may have both.
 */
#if defined(SL_LANES_H)
#define SL_NOISE(name) slv_##name
#define SL_NOISE_REAL sl_v
#define SL_NOISE_WORD sl_b /* 32 bits in 64, for products */
#define SL_NOISE_NUMBER(x) slv_set(x)
#define SL_NOISE_PRODUCT(a, b) slv_word_product(a, (SL_NOISE_WORD){0} + (b))
#elif defined(SL_NOISE_SINGLE)
#define SL_NOISE(name) slf_##name
#define SL_NOISE_REAL float
#define SL_NOISE_WORD uint64_t
#define SL_NOISE_NUMBER(x) x##f
#define SL_NOISE_PRODUCT(a, b) ((a) * (b))
#else
#define SL_NOISE(name) sl_##name
#define SL_NOISE_REAL double
#define SL_NOISE_WORD uint64_t
#define SL_NOISE_NUMBER(x) x
#define SL_NOISE_PRODUCT(a, b) ((a) * (b))
#endif

#ifndef SL_PHILOX_H
#define SL_PHILOX_H

#define SL_NOISE_LOW UINT64_C(0xffffffff)

/* Four words of a counter and a key of two, in place of the counter. */
static inline void sl_philox(SL_NOISE_WORD counter[4], SL_NOISE_WORD key_0, SL_NOISE_WORD key_1) {
  int round;
  for (round = 0; round < 10; round++) {
    const SL_NOISE_WORD a = SL_NOISE_PRODUCT(counter[0], UINT64_C(0xd2511f53));
    const SL_NOISE_WORD b = SL_NOISE_PRODUCT(counter[2], UINT64_C(0xcd9e8d57));
    counter[0] = (b >> 32) ^ counter[1] ^ key_0;
    counter[1] = b & SL_NOISE_LOW;
    counter[2] = (a >> 32) ^ counter[3] ^ key_1;
    counter[3] = a & SL_NOISE_LOW;
    key_0 = (key_0 + UINT64_C(0x9e3779b9)) & SL_NOISE_LOW;
    key_1 = (key_1 + UINT64_C(0xbb67ae85)) & SL_NOISE_LOW;
  }
}

#endif

#if (defined(SL_NOISE_SINGLE) && !defined(SL_NOISE_SINGLE_H)) || \
    (!defined(SL_NOISE_SINGLE) && !defined(SL_NOISE_H))
#if defined(SL_NOISE_SINGLE)
#define SL_NOISE_SINGLE_H
#else
#define SL_NOISE_H
#endif

/* A word as a number, exact in double. */
static inline SL_NOISE_REAL SL_NOISE(noise_number)(SL_NOISE_WORD word) {
#if defined(SL_NOISE_SINGLE)
  return (float)word;
#else
  return SL_NOISE(real)(word | UINT64_C(0x4330000000000000)) - SL_NOISE_NUMBER(4503599627370496.0);
#endif
}

/* Standard normal numbers z[0] ... z[3] of channels 4 block ... 4 block + 3; of pairs, 1 asks for
 * the first two, 2 for the last two, 3 for both; z is left as it is where none are asked for. */
static inline void SL_NOISE(noise)(
    SL_NOISE_WORD seed,
    SL_NOISE_WORD run,
    SL_NOISE_WORD sample,
    SL_NOISE_WORD block,
    unsigned pairs,
    SL_NOISE_REAL z[4]) {
  SL_NOISE_WORD words[4];
  unsigned i;
  words[0] = sample & SL_NOISE_LOW;
  words[1] = sample >> 32;
  words[2] = block;
  words[3] = run >> 32;
  sl_philox(words, seed, run & SL_NOISE_LOW);
  for (i = 0; i < 4; i += 2) {
    if (((pairs >> (i / 2)) & 1u) == 0) continue;
    /* 2^-32 and 2 pi 2^-32: never the logarithm of 0 */
    const SL_NOISE_REAL share =
        (SL_NOISE(noise_number)(words[i]) + SL_NOISE_NUMBER(0.5)) *
        SL_NOISE_NUMBER(2.3283064365386963e-10);
    const SL_NOISE_REAL angle =
        SL_NOISE(noise_number)(words[i + 1]) * SL_NOISE_NUMBER(1.4629180792671596e-9);
    const SL_NOISE_REAL radius = SL_NOISE(sqrt)(SL_NOISE_NUMBER(-2.0) * SL_NOISE(log)(share));
    SL_NOISE_REAL sine, cosine;
    SL_NOISE(sincos)(angle, &sine, &cosine);
    z[i] = radius * cosine;
    z[i + 1] = radius * sine;
  }
}

#endif

#undef SL_NOISE
#undef SL_NOISE_REAL
#undef SL_NOISE_WORD
#undef SL_NOISE_NUMBER
#undef SL_NOISE_PRODUCT
