/*
 * metrics.h - what a run is judged by, accumulated while it runs, so that no trajectory need be kept.
 *
 * Per joint. What each metric is stands with its declaration (METRICS in model/quantities.py), from which kernel.h has
 * the enumeration SL_RESPONSE_TIME ... SL_METRICS_PER_JOINT.
 *
 * Samples are taken at the beginning of every step, and at the end. NaN stands for "there is none": never reached, not
 * settled, e(0) = 0, the run stopped before, or before its first sample.
 */
#ifndef SL_METRICS_H
#define SL_METRICS_H

/* Accumulators of one joint on one group of lanes. */
typedef struct {
  sl_v response_band, settling_band, side; /* thresholds on |e|; sign of e(0) */
  sl_v value[SL_METRICS_PER_JOINT];        /* of integrals the sum over samples; of chatter, the total variation */
  sl_v first_size, size;                   /* |e| of the first sample, and of the last */
  sl_v first_u;
  sl_v least_u, most_u;                    /* since the run began, in its second half since that began */
  sl_v u, sigma, dq1;                      /* of the last sample */
} sl_metrics;

/* When a sample is taken. */
typedef struct {
  double time;               /* s */
  int half_begins, in_half;  /* it is the first of the run's second half; a later one of it */
  int late;                  /* it lies in the run's last quarter */
} sl_instant;

/* The bands are band |e(0)| + error: one of the two is 0. */
static inline void sl_metrics_start(sl_metrics *m, sl_v e, sl_v u, sl_v sigma, sl_v dq1, const sl_job *job) {
  int i;
  for (i = 0; i < SL_METRICS_PER_JOINT; i++) m->value[i] = slv_set(0.0);
  m->value[SL_RESPONSE_TIME] = slv_set(SL_INF);
  m->value[SL_U_MAX] = slv_set(-SL_INF);
  m->least_u = slv_set(SL_INF);
  m->most_u = slv_set(-SL_INF);
  m->response_band = slv_fabs(e) * slv_set(job->response_band) + slv_set(job->response_error);
  m->settling_band = slv_fabs(e) * slv_set(job->settling_band) + slv_set(job->settling_error);
  m->side = slv_sign(e);
  m->first_size = m->size = slv_fabs(e);
  m->u = m->first_u = u;
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
  v[SL_RMS_ERROR] = v[SL_RMS_ERROR] + size * size;
  v[SL_IAE] = v[SL_IAE] + size;
  v[SL_U_RMS] = v[SL_U_RMS] + u * u;
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

/* Integral by the trapezoid rule, h apart, of what has this sum over the samples, and began and ended so. */
static inline double sl_integral(double sum, double first, double last, double h) {
  return h * (sum - 0.5 * (first + last));
}

/*
 * Metrics of lane j into out[SL_METRICS_PER_JOINT]. `h` is the time between samples, `half` the length of the run's second
 * half, s; `complete` is 0 for a run that stopped before its end.
 */
static inline void sl_metrics_finish(const sl_metrics *m, int j, double start, double end, double h, double half,
                                     int complete, double *out) {
  const double first_e = slv_get(m->first_size, j), last_e = slv_get(m->size, j), first_u = slv_get(m->first_u, j);
  const double last_u = slv_get(m->u, j), time = end - start;
  const double range = slv_get(m->most_u, j) - slv_get(m->least_u, j), largest = slv_get(sl_largest(m), j);
  int i, settled;
  for (i = 0; i < SL_METRICS_PER_JOINT; i++) out[i] = slv_get(m->value[i], j);
  if (slv_get(m->side, j) == 0.0) out[SL_OVERSHOOT] = SL_NAN;
  if (!(slv_get(m->response_band, j) > 0.0 && out[SL_RESPONSE_TIME] < SL_INF)) out[SL_RESPONSE_TIME] = SL_NAN;
  settled = complete && slv_get(m->settling_band, j) > 0.0 && out[SL_SETTLING_TIME] <= start + 0.98 * time;
  if (!settled) out[SL_SETTLING_TIME] = out[SL_U_TV] = out[SL_SIGMA_TV] = out[SL_DQ1_TV] = SL_NAN;
  out[SL_IAE] = sl_integral(out[SL_IAE], first_e, last_e, h);
  out[SL_RMS_ERROR] = sl_integral(out[SL_RMS_ERROR], first_e * first_e, last_e * last_e, h);
  out[SL_U_RMS] = sl_integral(out[SL_U_RMS], first_u * first_u, last_u * last_u, h);
  out[SL_RMS_ERROR] = time > 0.0 ? sl_sqrt(sl_fmax(out[SL_RMS_ERROR], 0.0) / time) : last_e;
  out[SL_U_RMS] = time > 0.0 ? sl_sqrt(sl_fmax(out[SL_U_RMS], 0.0) / time) : sl_fabs(last_u);
  out[SL_U_MAX] = sl_fabs(largest);
  if (out[SL_CHATTER] > 0.0) out[SL_CHATTER] = out[SL_CHATTER] / half / sl_fmax(range, 1e-3 * out[SL_U_MAX]);
  if (!complete) out[SL_STEADY_STATE_ERROR] = out[SL_CHATTER] = SL_NAN;
  if (largest < 0.0) {
    out[SL_OVERSHOOT] = out[SL_RMS_ERROR] = out[SL_IAE] = out[SL_U_MAX] = out[SL_U_RMS] = SL_NAN;
  }
}

#endif
