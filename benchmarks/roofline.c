/*
 * roofline.c - how many fused multiply-adds a core can do: twelve independent chains of them on whole vectors, enough to
 * fill two units of four to five cycles' latency.
 */
#include <stdint.h>

typedef double vector __attribute__((vector_size(8 * WIDTH)));

/* Returns a sum of the results, so that none of them is left out. `rounds` times 12 * WIDTH fused multiply-adds. */
double spin(int64_t rounds, double factor, double term) {
  vector a[12], sum = {0.0};
  const vector scale = factor - (vector){0.0}, shift = term - (vector){0.0};
  double total = 0.0;
  int64_t k;
  int i;
  for (i = 0; i < 12; i++) a[i] = (double)i - (vector){0.0};
  for (k = 0; k < rounds; k++) {
#pragma GCC unroll 12
    for (i = 0; i < 12; i++) a[i] = a[i] * scale + shift;
  }
  for (i = 0; i < 12; i++) sum += a[i];
  for (i = 0; i < WIDTH; i++) total += sum[i];
  return total;
}
