/*
 * handwritten.c - the paper's closed loop as one would write it by hand for one processor core, one run at a time.
 *
 * The variable power log law under shake, RK4, with the paper's numbers as literals and the boundary layer delta as
 * the one varied parameter. What depends on time only is tabulated once for all runs; the sine and cosine of theta3
 * serve control and plant; the two branches of (19) are one power; h^(-4/3) is the fourth power of h^(-1/3); the
 * square roots of alpha = 1/2 are square roots; M1 is inverted with one division.
 */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

/* Arm and drive: kg, kg m^2, m, m/s^2, N/m, N m/rad. */
static const double m2 = 10.0, m3 = 40.0, J = 40.0 * 0.74 * 0.74 / 3.0, L3 = 0.74, g = 9.8;
static const double motor_lift = 2.0, motor_rotation = 0.01, k_lift = 2.0e6, k_rotation = 2.0e4;
/* Control. */
static const double k1 = 3.0, k2 = 5.0, k3 = 12.0, epsilon = 10.0, zeta = 0.9, a_max = 200.0;
static const double mu_lift = 12.0, mu_rotation = 5.0, lambda = 5.0, Kf_lift = 200.0, Kf_rotation = 2.6;
/* Shake, m and rad/s. */
static const double shake_amplitude = 0.1, shake_omega = 10.0;
static const double pi = 3.14159265358979323846;

typedef struct {
  double y, theta, dy, dtheta, ddy, ddtheta; /* reference */
  double ddb;                                /* shake acceleration, m/s^2 */
  double unused;                             /* a cache line each */
} signals;

typedef struct {
  double lift, rotation;
} pair;

static signals signals_at(double t) {
  const double a = pi * t, b = 0.5 * pi * t;
  signals s;
  s.y = sin(a);
  s.dy = pi * cos(a);
  s.ddy = -pi * pi * s.y;
  s.theta = 1.0 + sin(b);
  s.dtheta = 0.5 * pi * cos(b);
  s.ddtheta = -0.25 * pi * pi * sin(b);
  s.ddb = -shake_amplitude * shake_omega * shake_omega * sin(shake_omega * t);
  s.unused = 0.0;
  return s;
}

/* u_e of (25) for one joint: the reaching law (18), clipped, minus the surface's own derivative. */
static inline double wished_acceleration(double e, double de, double mu, double delta2) {
  const double e2 = e * e, h = e2 + delta2, root = exp(log(h) * (-1.0 / 3.0)), root2 = root * root;
  const double sigma = de + e * (mu * e2 + lambda * root);
  const double size = fabs(sigma), log_term = log1p(epsilon * (size * size)), sqrt_log = sqrt(log_term);
  const double rate = k1 * pow(size, zeta * (size > 1.0 ? size : 1.0)) + sqrt_log * (k2 * log_term + k3);
  const double slope = 3.0 * mu * e2 + lambda * (root2 * root2) * (e2 * (1.0 / 3.0) + delta2);
  return -copysign(rate < a_max ? rate : a_max, sigma) - de * slope;
}

/* U = U_s + U_f, (14) and (33). */
static inline pair control(const signals *now, const double *x, double sine, double cosine, double delta2) {
  const double a_lift =
      now->ddy - wished_acceleration(now->y - x[0], now->dy - x[2], mu_lift, delta2);
  const double a_rotation =
      now->ddtheta - wished_acceleration(now->theta - x[1], now->dtheta - x[3], mu_rotation, delta2);
  const double coupling = m3 * L3 * cosine;
  pair u;
  u.lift = (m2 + m3 + motor_lift) * a_lift + coupling * a_rotation - m3 * L3 * sine * (x[3] * x[3]) + (m2 + m3) * g +
           Kf_lift * (x[2] - x[6]);
  u.rotation = coupling * (a_lift + g) + (m3 * L3 * L3 + J + motor_rotation) * a_rotation + Kf_rotation * (x[3] - x[7]);
  return u;
}

/* dx/dt of x = [q1, dq1, q2, dq2], (1). */
static inline void plant(const signals *now, const double *x, pair u, double sine, double cosine, double *dx) {
  const double a = m2 + m3, b = m3 * L3 * cosine, d = m3 * L3 * L3 + J;
  const double z_lift = k_lift * (x[4] - x[0]), z_rotation = k_rotation * (x[5] - x[1]);
  const double felt = g + now->ddb;
  const double f_lift = z_lift + m3 * L3 * sine * (x[3] * x[3]) - a * felt, f_rotation = z_rotation - b * felt;
  const double inverse = 1.0 / (a * d - b * b);
  dx[0] = x[2];
  dx[1] = x[3];
  dx[2] = (d * f_lift - b * f_rotation) * inverse;
  dx[3] = (a * f_rotation - b * f_lift) * inverse;
  dx[4] = x[6];
  dx[5] = x[7];
  dx[6] = (u.lift - z_lift) * (1.0 / motor_lift);
  dx[7] = (u.rotation - z_rotation) * (1.0 / motor_rotation);
}

/* One run from the paper's initial state; `table` holds the signals at half steps. */
static inline void run(const signals *table, int64_t steps, double h, int sampled, double delta, double *final_state) {
  static const double node[4] = {0.0, 0.5, 0.5, 1.0}, weight[4] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
  static const int when[4] = {0, 1, 1, 2};
  const double delta2 = delta * delta;
  double x[8] = {0.8, 0.5, 0.0, 0.0, 0.8, 0.5, 0.0, 0.0};
  int64_t k;
  int stage, i;
  for (k = 0; k < steps; k++, table += 2) {
    pair u = {0.0, 0.0};
    double sum[8], at[8], dx[8];
    for (i = 0; i < 8; i++) sum[i] = x[i];
    for (stage = 0; stage < 4; stage++) {
      double sine, cosine;
      for (i = 0; i < 8; i++) at[i] = stage == 0 ? x[i] : x[i] + node[stage] * h * dx[i];
      sine = sin(at[1]);
      cosine = cos(at[1]);
      if (stage == 0 || !sampled) u = control(&table[when[stage]], at, sine, cosine, delta2);
      plant(&table[when[stage]], at, u, sine, cosine, dx);
      for (i = 0; i < 8; i++) sum[i] += weight[stage] * h * dx[i];
    }
    for (i = 0; i < 8; i++) x[i] = sum[i];
  }
  for (i = 0; i < 8; i++) final_state[i] = x[i];
}

/* `runs` runs of `steps` steps of h s, one per entry of delta; final states are runs x 8. Returns 0 or, without
   memory, 1. */
int simulate(int64_t runs, int64_t steps, double h, int sampled, const double *delta, double *final_states) {
  signals *table = malloc((size_t)(2 * steps + 1) * sizeof *table);
  int64_t i;
  if (!table) return 1;
  for (i = 0; i <= 2 * steps; i++) table[i] = signals_at(0.5 * h * (double)i);
  for (i = 0; i < runs; i++) {
    if (sampled) {
      run(table, steps, h, 1, delta[i], final_states + 8 * i);
    } else {
      run(table, steps, h, 0, delta[i], final_states + 8 * i);
    }
  }
  free(table);
  return 0;
}
