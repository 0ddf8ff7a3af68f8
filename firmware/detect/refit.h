/* One Gauss-Newton step on the points' geometric distances from an ellipse that is nearly right, and
 * what the points say about it: residual, how much of the circumference they cover.
 *
 * In the frame where the ellipse is the unit circle, p = B^-1 (x - c), a change of centre and shape
 * moves the curve outwards by J d with J = (p, q, 1, p^2 - q^2, 2 p q), d = (centre, size, two of
 * elongation). A point's distance from the curve in pixels is f / |grad f| to first order (Sampson), with
 * f = (p^2 + q^2 - 1) / 2 and grad f = B'^-1 p. So the step solves (J' W J) d = J' W f with weights
 * 1 / |grad f|^2: the maximum-likelihood fit for equal independent errors along the normals. */
#ifndef TESSERA_FIRMWARE_DETECT_REFIT_H
#define TESSERA_FIRMWARE_DETECT_REFIT_H

#include "firmware/detect/ellipse.h"

struct refit_quality {
    uint32_t residual_px_q16; /* RMS distance of the points from the refitted ellipse              */
    uint16_t sectors;         /* bit i: a point lies in the i-th 16th of the circumference (unit frame) */
};

/* Improves *ellipse. False when the points are no ellipse near it: too far off for one step, or too short
 * an arc to tell. count is at most DIRECTFIT_POINTS_MAX. */
bool refit_ellipse(const int32_t x_px_q16[], const int32_t y_px_q16[], uint32_t count,
                   struct ellipse *ellipse, struct refit_quality *quality);

#endif
