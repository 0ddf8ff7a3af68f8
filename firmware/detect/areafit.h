/* A closed contour -> ellipse, by the moments of the area that it encloses.
 *
 * An ellipse is told by area, centroid and second moments: the moments' matrix over the area is S / 4. By
 * Green's theorem they are integrals along the contour; with c dA twice the area of the triangle between the
 * origin and a step along the contour,
 *
 *   A = 1/2 sum c,   A m_x = 1/3 sum c x,   A m_xx = 1/4 sum c x^2,
 *
 * with each point's c the mean of the steps beside it: the trapezoidal rule, which for evenly spaced points on
 * an ellipse has no error. To first order in the points' distances from the ellipse this is the fit of least
 * squares, with all points' noise taken alike in the frame where the ellipse is the unit circle.
 *
 * How far the points lie from it needs no second look at them. With rho the radius in that frame, rho^2 = 1 + u,
 * the area is pi (1 + mean u) and the moments' trace pi / 2 (1 + 2 mean u + mean u^2); that they belong
 * to one unit circle means mean u = -mean u^2. So what the contour's area lacks of pi a b is the mean
 * square of u, which is twice the distance over the radius. */
#ifndef TESSERA_FIRMWARE_DETECT_AREAFIT_H
#define TESSERA_FIRMWARE_DETECT_AREAFIT_H

#include "firmware/detect/ellipse.h"

#define AREAFIT_POINTS_MIN 8u
#define AREAFIT_POINTS_MAX 4096u

struct areafit {
    struct ellipse ellipse;
    int32_t        residual_px2_q12; /* mean square distance of the contour from the ellipse */
    bool           clockwise;        /* as seen on the image                              */
};

/* Neighbours among the points, the last and the first too, are at most 1 px apart in x and in y. False for
 * areas below 1/512 of the square of the number of points, which has no ellipse of axes nearer than 1 : 8, and for
 * ellipses that the struct cannot hold. The arithmetic alone errs by less than 2e-5 of the size
 * (tests/unit/test_areafit.c). */
bool areafit_ellipse(const int32_t x_px_q16[], const int32_t y_px_q16[], uint32_t count,
                     struct areafit *out);

#endif
