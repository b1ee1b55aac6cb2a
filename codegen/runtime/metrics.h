/*
 * metrics.h - what a run is judged by, accumulated while it runs, so that no trajectory need be kept.
 *
 * Per joint, with e the tracking error and T the run's duration:
 *   response time       first t with |e| <= response_band |e(0)|
 *   settling time       last t with |e| > settling_band |e(0)|; NaN if that is within the last 2 % of the run
 *   overshoot           largest excursion of e past zero, against the sign of e(0)
 *   steady-state error  largest |e| over the last quarter of the run
 *   iae                 integral of |e|, by the trapezoid rule
 *   U_max               largest |U|
 *   chatter             total variation of U over the second half of the run, by that half's length and by the range of
 *                       U in it, or 1e-3 of U_max where that is more, 1/s; 0 for a U that stands still
 *   U, sigma, dq1 tv    total variation after the settling time
 * Samples are taken at the beginning of every step, and at the end. NaN stands for "there is none": never reached, not
 * settled, e(0) = 0, the run stopped before, or before its first sample.
 */
#ifndef SL_METRICS_H
#define SL_METRICS_H

enum {
  SL_RESPONSE_TIME,
  SL_SETTLING_TIME,
  SL_OVERSHOOT,
  SL_STEADY_STATE_ERROR,
  SL_IAE,
  SL_U_MAX,
  SL_CHATTER,
  SL_U_TV,
  SL_SIGMA_TV,
  SL_DQ1_TV,
  SL_METRICS_PER_JOINT
};

/* Accumulators of one joint on one group of lanes. */
typedef struct {
  sl_v response_band, settling_band, side; /* thresholds on |e|; sign of e(0) */
  sl_v value[SL_METRICS_PER_JOINT];        /* of iae, the sum of |e|; of chatter, the total variation */
  sl_v first_size, size;                   /* |e| of the first sample, and of the last */
  sl_v least_u, most_u;                    /* since the run began, in its second half since that began */
  sl_v u, sigma, dq1;                      /* of the last sample */
} sl_metrics;

/* When a sample is taken. */
typedef struct {
  double time;               /* s */
  int half_begins, in_half;  /* it is the first of the run's second half; a later one of it */
  int late;                  /* it lies in the run's last quarter */
} sl_instant;

static inline void sl_metrics_start(sl_metrics *m, sl_v e, sl_v u, sl_v sigma, sl_v dq1, double response_band,
                                    double settling_band) {
  int i;
  for (i = 0; i < SL_METRICS_PER_JOINT; i++) m->value[i] = slv_set(0.0);
  m->value[SL_RESPONSE_TIME] = slv_set(SL_INF);
  m->value[SL_U_MAX] = slv_set(-SL_INF);
  m->least_u = slv_set(SL_INF);
  m->most_u = slv_set(-SL_INF);
  m->response_band = slv_fabs(e) * slv_set(response_band);
  m->settling_band = slv_fabs(e) * slv_set(settling_band);
  m->side = slv_sign(e);
  m->first_size = m->size = slv_fabs(e);
  m->u = u;
  m->sigma = sigma;
  m->dq1 = dq1;
}

/* The largest |U| so far; -inf before the first sample. */
static inline sl_v sl_largest(const sl_metrics *m) {
  return slv_fmax(m->value[SL_U_MAX], slv_fmax(-m->least_u, m->most_u));
}

static inline void sl_metrics_sample(sl_metrics *m, sl_instant now, sl_v e, sl_v u, sl_v sigma, sl_v dq1) {
  const sl_v t = slv_set(now.time), size = slv_fabs(e), zero = slv_set(0.0), turn = slv_fabs(u - m->u);
  const sl_m outside = size > m->settling_band;
  sl_v *v = m->value;
  v[SL_RESPONSE_TIME] = slv_select(size <= m->response_band, slv_fmin(t, v[SL_RESPONSE_TIME]), v[SL_RESPONSE_TIME]);
  v[SL_SETTLING_TIME] = slv_select(outside, t, v[SL_SETTLING_TIME]);
  v[SL_OVERSHOOT] = slv_fmax(v[SL_OVERSHOOT], -(e * m->side));
  if (now.late) v[SL_STEADY_STATE_ERROR] = slv_fmax(v[SL_STEADY_STATE_ERROR], size);
  v[SL_IAE] = v[SL_IAE] + size;
  if (now.half_begins) {
    v[SL_U_MAX] = sl_largest(m);
    m->least_u = m->most_u = u;
  }
  m->least_u = slv_fmin(m->least_u, u);
  m->most_u = slv_fmax(m->most_u, u);
  if (now.in_half) v[SL_CHATTER] = v[SL_CHATTER] + turn;
  v[SL_U_TV] = slv_select(outside, zero, v[SL_U_TV] + turn);
  v[SL_SIGMA_TV] = slv_select(outside, zero, v[SL_SIGMA_TV] + slv_fabs(sigma - m->sigma));
  v[SL_DQ1_TV] = slv_select(outside, zero, v[SL_DQ1_TV] + slv_fabs(dq1 - m->dq1));
  m->size = size;
  m->u = u;
  m->sigma = sigma;
  m->dq1 = dq1;
}

/*
 * Metrics of lane j into out[SL_METRICS_PER_JOINT]. `h` is the time between samples, `half` the length of the run's second
 * half, s; `complete` is 0 for a run that stopped before its end.
 */
static inline void sl_metrics_finish(const sl_metrics *m, int j, double start, double end, double h, double half,
                                     int complete, double *out) {
  const double range = slv_get(m->most_u, j) - slv_get(m->least_u, j), largest = slv_get(sl_largest(m), j);
  int i, settled;
  for (i = 0; i < SL_METRICS_PER_JOINT; i++) out[i] = slv_get(m->value[i], j);
  if (slv_get(m->side, j) == 0.0) out[SL_RESPONSE_TIME] = out[SL_OVERSHOOT] = SL_NAN;
  if (!(out[SL_RESPONSE_TIME] < SL_INF)) out[SL_RESPONSE_TIME] = SL_NAN;
  settled = complete && slv_get(m->side, j) != 0.0 && out[SL_SETTLING_TIME] <= start + 0.98 * (end - start);
  if (!settled) out[SL_SETTLING_TIME] = out[SL_U_TV] = out[SL_SIGMA_TV] = out[SL_DQ1_TV] = SL_NAN;
  out[SL_IAE] = h * (out[SL_IAE] - 0.5 * (slv_get(m->first_size, j) + slv_get(m->size, j)));
  out[SL_U_MAX] = sl_fabs(largest);
  if (out[SL_CHATTER] > 0.0) out[SL_CHATTER] = out[SL_CHATTER] / half / sl_fmax(range, 1e-3 * out[SL_U_MAX]);
  if (!complete) out[SL_STEADY_STATE_ERROR] = out[SL_CHATTER] = SL_NAN;
  if (largest < 0.0) out[SL_OVERSHOOT] = out[SL_IAE] = out[SL_U_MAX] = SL_NAN;
}

#endif
