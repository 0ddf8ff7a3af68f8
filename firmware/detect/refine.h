/* The last word on a feature's place: the ellipse and the brightness profile across its edge, fitted to
 * the pixels themselves.
 *
 * Filters smooth noise into their neighbours and mix edges that lie close; a fit of the known appearance
 * does neither. In the unit frame of the ellipse found so far (refit.h) a pixel lies at distance
 * d = (1 - rho) h inside the edge, h = rho / |grad f|, and should have the brightness
 *
 *   I = b + c g(rho) P(d / s),   P the normal integral,
 *
 * for outside level b, contrast c and blur s (optics and the pixel's own width together); g is the circle's
 * printed Gaussian peak over its level at the edge, 1 outside. Where the edge moves outwards by J theta in
 * the unit frame, I grows by c g P'(d / s) h / s J theta. So I is linear in
 *
 *   (c theta_0..4 / s, b, c, c ds / s),
 *
 * and one weighted least-squares solution from raw pixels gives all of it; a second one on what is left
 * over removes the first one's linearisation and measures the noise. Pixels err independently, so the
 * solution's covariance is the centre's, and the Cramer-Rao limit is reached where the model holds.
 *
 * Light that falls unevenly tilts b and c over the circle, which would draw the centre to the bright side: the
 * second pass takes their slopes from planes through the black and the white around many circles.
 *
 * Only pixels near the edge speak: within 2 s. The triangle's own edges reach into that band where the circle
 * is small: where the colours behind them are known (pattern.h) they are part of the model, c / g(1) times
 * their profile; where not, pixels near them are left out. */
#ifndef TESSERA_FIRMWARE_DETECT_REFINE_H
#define TESSERA_FIRMWARE_DETECT_REFINE_H

#include "firmware/detect/boardmap.h"
#include "firmware/detect/marks.h"
#include "firmware/detect/patches.h"
#include "firmware/detect/pattern.h"
#include "firmware/detect/rim.h"
#include "firmware/detect/steer.h"

struct refine {
    struct rim rim;
    struct boardmap_pair *pairs; /* of one patch                  */
    struct rim_view *views;      /* of its features, by index     */
    uint32_t *near;              /* circles whose light is looked at */
    uint32_t  circle_ratio_q16;
    uint32_t  kernel_sigma_px_q16;
    int32_t   blur_px_q16;       /* typical of the frame; 0 when nothing was refined */
    int32_t   edge_blur_px_q16;  /* the same of large circles, for straight edges    */
    uint32_t  noise_max_q16;     /* largest noise over contrast that counts,         */
    uint32_t  worst_max_q16;     /* and largest of one eighth of the rim             */
    uint32_t  refined;           /* counters of the frame */
    uint32_t  refused;
};

void refine_init(struct refine *refine, struct arena *arena, const struct dsp_kernels *dsp,
                 const struct patches_settings *settings, uint32_t kernel_sigma_px_q16,
                 unsigned width);

/* Improves the marks that the patches name: ellipse, size and sigma. A circle whose pixels do not look as
 * they should (something covers a part of it, another edge) is taken out of its patch. */
void refine_marks(struct refine *refine, const struct frame_view *frame, struct patches *patches,
                  struct marks *marks);

/* The same for one mark whose ellipse is a prediction, by the frame's typical blur and noise: ellipse, colour and
 * size must be set. False where there is no such circle; *mark is then unchanged. After refine_marks. */
bool refine_predicted(const struct refine *refine, const struct frame_view *frame,
                      const struct pattern_edges *edges, const struct patch_light *light,
                      struct mark *mark);

#endif
