/* Contours -> ellipses. A closed contour is tried whole, by the area in it (areafit.h). What is no ellipse, or is
 * open, is cut where it stops bending one way (lines, corners: arcs.h), and each arc that turns far enough is tried
 * alone, by its points (directfit.h, refit.h); arcs too short to tell wait until the frame ends and are then merged
 * with others that lie on the same ellipse.
 *
 * The colour comes from the gradient against the curvature: contours run with the dark side on the left,
 * so one that turns around its centre clockwise as seen on the image encloses the bright side. */
#ifndef TESSERA_FIRMWARE_DETECT_ELLIPSES_H
#define TESSERA_FIRMWARE_DETECT_ELLIPSES_H

#include "firmware/detect/arcs.h"
#include "firmware/detect/ellipse.h"

/* What a fit must reach to count. */
#define ELLIPSES_POINTS_MIN           12u
#define ELLIPSES_MINOR_MIN_PX2_Q12    5898 /* 1.2 px squared */
#define ELLIPSES_AXIS_RATIO_MIN       5    /* minor >= major / 5: tilts to 78 degrees */
#define ELLIPSES_RESIDUAL_MAX_PX2_Q12 655  /* 0.4 px squared: noise 4 at contrast 40 under blur 2 gives 0.25 px */
/* A triangle's outline lies a fifth of its inradius from the nearest ellipse; a circle seen through a
 * strongly distorting lens a hundredth of its radius. */
#define ELLIPSES_RESIDUAL_SHARE       12
#define ELLIPSES_SECTORS_MIN          10u  /* of 16, for arcs */

struct ellipses_item {
    struct ellipse ellipse;
    uint16_t       gradient_mean_q3;
    bool           white; /* bright inside */
};

struct ellipses {
    struct ellipses_item *at;
    uint32_t              count;
    uint32_t              size;
    struct arcs           arcs;
    uint32_t              fits;      /* tried in this frame, at most fits_max */
    uint32_t              fits_max;
    bool                  truncated; /* no room for an ellipse, or for a fit  */
};

void ellipses_init(struct ellipses *ellipses, struct arena *arena, unsigned width, unsigned height);
void ellipses_begin(struct ellipses *ellipses);

/* Takes one finished contour; its points may come back in another order. */
void ellipses_add(struct ellipses *ellipses, struct contour *contour);

/* No more contours: merges the arcs that are left. */
void ellipses_end(struct ellipses *ellipses);

/* The list of a frame that was seen at half its size, in the frame's own pixels. What becomes too large is
 * dropped. */
void ellipses_double(struct ellipses *ellipses);

#endif
