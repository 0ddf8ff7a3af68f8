/* One circle: its ellipse and the brightness profile across its edge, fitted to the pixels themselves.
 *
 * Filters smooth noise into their neighbours and mix edges that lie close; a fit of the known appearance
 * does neither. In the unit frame of the ellipse found so far (refit.h) a pixel lies at distance
 * d = (1 - rho) h inside the edge, h = rho / |grad f|, and should have the brightness
 *
 *   I = b + c E,   E = e / g1 P(t) + A exp(-rho^2 (n0 - n1 y)),   P the normal integral,
 *
 * for outside level b, contrast c and blur s (optics and the pixel's own width together). t is d / s as an edge
 * that bends within the blur shows it (curve.h); the circle's level is e at its edge plus a Gaussian peak, g1 at
 * the rim in all, and A, n0, n1 are that peak blurred (rim.c). Where the edge moves outwards by J theta in the
 * unit frame, I grows by c e / g1 P'(t) h / s J theta. So I is linear in
 *
 *   (c theta_0..4 / s, b, c, c ds / s),
 *
 * and one weighted least-squares solution from raw pixels gives all of it; a second one on what is left
 * over removes the first one's linearisation and measures the noise; either goes again where it led far. Pixels
 * err independently, so the solution's covariance is the centre's, and the Cramer-Rao limit is reached where the
 * model holds. On circles of a few blurs size, contrast and blur can stand for one another: there the blur is held
 * at what large circles tell.
 *
 * Light that falls unevenly tilts b and c over the circle, which would draw the centre to the bright side: the
 * second pass takes their slopes from surfaces through the black and the white around many circles.
 *
 * Only pixels near the edge speak: within 2 s in the first pass and 1.6 s in the second. The triangle's own edges
 * reach into that band where the circle is small: where the colours behind them are known (pattern.h) they are part
 * of the model, c / g1 times their profile; where not, pixels near them are left out. */
#ifndef TESSERA_FIRMWARE_DETECT_CIRCLEFIT_H
#define TESSERA_FIRMWARE_DETECT_CIRCLEFIT_H

#include "firmware/detect/marks.h"
#include "firmware/detect/patches.h"
#include "firmware/detect/rim.h"

struct circlefit {
    struct rim rim;
    uint32_t   circle_ratio_q16;
    uint32_t   kernel_sigma_px_q16;
};

void circlefit_init(struct circlefit *fit, struct arena *arena, const struct dsp_kernels *dsp,
                    const struct patches_settings *settings, uint32_t kernel_sigma_px_q16);

/* A view of the mark's ellipse, without blur, edges and light. False for shapes that cannot be fitted. */
bool circlefit_start(const struct circlefit *fit, const struct mark *mark, struct rim_view *view);

/* A first blur from the slope of the mark's filtered edge and the pixels inside and out. */
bool circlefit_estimate_blur(const struct circlefit *fit, const struct frame_view *frame,
                             const struct mark *mark, struct rim_view *view);

/* The first solution, from raw pixels and the blur in *view. False where there is no circle of this
 * colour. */
bool circlefit_coarse(const struct circlefit *fit, const struct frame_view *frame,
                      struct rim_view *view, bool white);

/* The second, from what the first left over: ellipse, size, sigma and noise of the mark. False leaves it as it
 * was. */
bool circlefit_fine(const struct circlefit *fit, const struct frame_view *frame,
                    struct rim_view *view, struct mark *mark);

/* Whether the triangle's edges are so far from the circle that the fit cannot feel them. */
bool circlefit_is_roomy(const struct rim_view *view, int32_t blur_px_q16);

#endif
