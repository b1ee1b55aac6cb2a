/*
 * sl_casadi.h - gives the C that CasADi prints springline's elementary functions in place of the
 * host's.
 *
 * CasADi's files call sin, pow, fmin, ... by their C99 names. With SL_HOST_LIBM defined they are
 * the host's, and results then differ in the last bits from machine to machine.
 */
#ifndef SL_CASADI_H
#define SL_CASADI_H

#ifdef SL_HOST_LIBM
#include <math.h>
#define SL_INF HUGE_VAL
#else
#include "sl_math.h"
#define sin sl_sin
#define cos sl_cos
#define tan sl_tan
#define exp sl_exp
#define expm1 sl_expm1
#define log sl_log
#define log1p sl_log1p
#define pow sl_pow
#define sqrt sl_sqrt
#define fabs sl_fabs
#define fmin sl_fmin
#define fmax sl_fmax
#define floor sl_floor
#define ceil sl_ceil
#define copysign sl_copysign
#define hypot sl_hypot
#define sinh sl_sinh
#define cosh sl_cosh
#define tanh sl_tanh
#define asin sl_asin
#define acos sl_acos
#define atan sl_atan
#define atan2 sl_atan2
#endif

#endif
