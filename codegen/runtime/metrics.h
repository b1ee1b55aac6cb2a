/*
 * metrics.h - what a run is judged by, accumulated while it runs, so that no trajectory need be kept.
 *
 * Per joint, with e the tracking error and T the run's duration:
 *   response time       first t with |e| <= response_band |e(0)|
 *   settling time       last t with |e| > settling_band |e(0)|; NaN if that is within the last 2 % of the run
 *   overshoot           largest excursion of e past zero, against the sign of e(0)
 *   steady-state error  largest |e| over the last quarter of the run
 *   iae                 sum of |e| h over the steps
 *   U_max               largest |U|
 *   U, sigma, dq1 tv    total variation after the settling time
 * NaN stands for "there is none": never reached, not settled, e(0) = 0, or the run stopped before.
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
  SL_U_TV,
  SL_SIGMA_TV,
  SL_DQ1_TV,
  SL_METRICS_PER_JOINT
};

/* Accumulators of one joint on one group of lanes. */
typedef struct {
  sl_v response_band, settling_band, side; /* thresholds on |e|; sign of e(0) */
  sl_v value[SL_METRICS_PER_JOINT];
  sl_v u, sigma, dq1; /* of the sample before */
} sl_metrics;

static inline void sl_metrics_start(sl_metrics *m, sl_v e, sl_v u, sl_v sigma, sl_v dq1, double response_band,
                                    double settling_band) {
  int i;
  for (i = 0; i < SL_METRICS_PER_JOINT; i++) m->value[i] = slv_set(0.0);
  m->value[SL_RESPONSE_TIME] = slv_set(SL_INF);
  m->response_band = slv_fabs(e) * slv_set(response_band);
  m->settling_band = slv_fabs(e) * slv_set(settling_band);
  m->side = slv_sign(e);
  m->u = u;
  m->sigma = sigma;
  m->dq1 = dq1;
}

/* A sample at time t; `late` says that it lies in the last quarter of the run, h is 0 for the last sample. */
static inline void sl_metrics_sample(sl_metrics *m, double time, double h, int late, sl_v e, sl_v u, sl_v sigma,
                                     sl_v dq1) {
  const sl_v t = slv_set(time), size = slv_fabs(e), zero = slv_set(0.0);
  const sl_m outside = size > m->settling_band;
  sl_v *v = m->value;
  v[SL_RESPONSE_TIME] = slv_select(size <= m->response_band, slv_fmin(t, v[SL_RESPONSE_TIME]), v[SL_RESPONSE_TIME]);
  v[SL_SETTLING_TIME] = slv_select(outside, t, v[SL_SETTLING_TIME]);
  v[SL_OVERSHOOT] = slv_fmax(v[SL_OVERSHOOT], -(e * m->side));
  if (late) v[SL_STEADY_STATE_ERROR] = slv_fmax(v[SL_STEADY_STATE_ERROR], size);
  v[SL_IAE] = v[SL_IAE] + size * slv_set(h);
  v[SL_U_MAX] = slv_fmax(v[SL_U_MAX], slv_fabs(u));
  v[SL_U_TV] = slv_select(outside, zero, v[SL_U_TV] + slv_fabs(u - m->u));
  v[SL_SIGMA_TV] = slv_select(outside, zero, v[SL_SIGMA_TV] + slv_fabs(sigma - m->sigma));
  v[SL_DQ1_TV] = slv_select(outside, zero, v[SL_DQ1_TV] + slv_fabs(dq1 - m->dq1));
  m->u = u;
  m->sigma = sigma;
  m->dq1 = dq1;
}

/* Metrics of lane j into out[SL_METRICS_PER_JOINT]; `complete` is 0 for a run that stopped before its end. */
static inline void sl_metrics_finish(const sl_metrics *m, int j, double start, double end, int complete, double *out) {
  int i, settled;
  for (i = 0; i < SL_METRICS_PER_JOINT; i++) out[i] = slv_get(m->value[i], j);
  if (slv_get(m->side, j) == 0.0) out[SL_RESPONSE_TIME] = out[SL_OVERSHOOT] = SL_NAN;
  if (!(out[SL_RESPONSE_TIME] < SL_INF)) out[SL_RESPONSE_TIME] = SL_NAN;
  settled = complete && slv_get(m->side, j) != 0.0 && out[SL_SETTLING_TIME] <= start + 0.98 * (end - start);
  if (!settled) out[SL_SETTLING_TIME] = out[SL_U_TV] = out[SL_SIGMA_TV] = out[SL_DQ1_TV] = SL_NAN;
  if (!complete) out[SL_STEADY_STATE_ERROR] = SL_NAN;
}

#endif
