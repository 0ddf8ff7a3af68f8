/* Edge points -> ellipse: the direct least-squares fit of Fitzgibbon, Pilu and Fisher (1999), in the
 * partitioned form of Halir and Flusser (1998).
 *
 * Minimises sum (a x^2 + b x y + c y^2 + d x + e y + f)^2 subject to 4 a c - b^2 = 1, which only
 * ellipses satisfy. With the points' scatter split into quadratic and linear monomials, S1, S2, S3,
 * and M = S1 - S2 S3^-1 S2' (the Schur complement, positive semidefinite), the answer is the eigenvector
 * of M v = lambda C v with the one positive lambda; where the points lie on an ellipse lambda is nearly
 * zero, so a few steps of inverse iteration give it.
 *
 * Range: the points are first whitened by their own covariance (the fit does not change under affine maps,
 * its conditioning does) to Q22 with |.| <= 2; sums of 4th powers of up to 4096 points stay below 2^60. */
#ifndef TESSERA_FIRMWARE_DETECT_DIRECTFIT_H
#define TESSERA_FIRMWARE_DETECT_DIRECTFIT_H

#include "firmware/detect/ellipse.h"

#define DIRECTFIT_POINTS_MIN 6u
#define DIRECTFIT_POINTS_MAX 4096u

/* False when the points are too few, nearly on a line (spread across it under 1/8 of that along it, or
 * under 1/3 px), or determine no ellipse that struct ellipse can hold. Error of the arithmetic alone:
 * below 2e-5 of the size for a whole ellipse (tests/unit/test_directfit.c). */
bool directfit_ellipse(const int32_t x_px_q16[], const int32_t y_px_q16[], uint32_t count,
                       struct ellipse *out);

#endif
