/* How a curved edge looks through blur.
 *
 * A straight edge blurred by s is Phi(d / s). That of an ellipse is not, where its radius of curvature comes near
 * to s: at the ends of a tilted circle's long axis. With tau = (1 - rho) (h / R) (R / s) the distance from the
 * edge in blurs as rim.h measures it, y = (R / h)^2 less its mean over the directions, and eps = s / R, the blurred
 * disc is Phi(t) with
 *     t = tau + eps (h / R) P(tau, y),   P = A0(y) + A1(y) tau + A2(y) tau^2 + A3(y) tau^3 + A4 tau^4,
 * A0, A1, A2 cubic, A3 linear in y: good to 0.001 of the swing for |tau| <= 2 (tools/gen/curve_table.py). */
#ifndef TESSERA_FIRMWARE_DETECT_CURVE_H
#define TESSERA_FIRMWARE_DETECT_CURVE_H

#include <stdint.h>

/* By eps = 0, 0.15 .. 0.9 and alpha = minor over major semi-axis. */
#define CURVE_BLURS   7u
#define CURVE_ASPECTS 6u
/* tau^j y^k: 00 01 02 03 10 11 12 13 20 21 22 23 30 31 40. */
#define CURVE_TERMS   15u
/* |y| at the smallest alpha; beyond it the polynomials mean nothing. */
#define CURVE_Y_MAX_Q14 23100 /* 1.41 */

extern const int16_t curve_table_q14[CURVE_BLURS][CURVE_ASPECTS][CURVE_TERMS];

/* The coefficients at eps and alpha, between the table's nodes; cut to its range. */
void curve_at(int64_t eps_q16, int64_t alpha_q16, int32_t terms_q14[CURVE_TERMS]);

#endif
