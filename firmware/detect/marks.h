/* Ellipses -> marks: what may be a circle of the target. Drops doubles and tells large from small.
 *
 * Doubles: a circle's Gaussian peak has its own ring of steepest slope inside the circle, of the same
 * colour (the outer one is the circle); a small triangle seen through blur may pass for an ellipse around its
 * circle, of the other colour (the inner one is the circle).
 *
 * Large and small: perspective changes sizes over the image, so each size is taken relative to the
 * median of its neighbourhood; these relative sizes are split by Otsu's threshold (1979), biased towards the
 * split whose classes stand in the target's known ratio. */
#ifndef TESSERA_FIRMWARE_DETECT_MARKS_H
#define TESSERA_FIRMWARE_DETECT_MARKS_H

#include "firmware/detect/ellipses.h"

#define MARKS_NONE UINT32_MAX

struct mark {
    struct ellipse ellipse;
    uint32_t       size_px_q16;   /* geometric mean of the semi-axes */
    uint32_t       sigma_px_q20;  /* of the centre, per axis; 0 before the last fit */
    uint16_t       gradient_q3;   /* mean of the filtered edge's slope */
    int32_t        blur_px_q16;   /* of the profile fit: refine.h; and                 */
    int32_t        level_q30;     /* the brightness around the circle, of 4096 grey_q4, */
    int32_t        contrast_q30;  /* and what the circle adds; 0 before the fit        */
    uint16_t       noise_q16;     /* once refined: pixel noise over contrast, saturated; */
    uint16_t       worst_q16;     /* and that of the noisiest eighth of the rim          */
    bool           white;
    bool           large;
};

/* Cells of MARKS_CELL_PX px: by rows, the marks whose centre lies in each follow those of the cell before. */
#define MARKS_CELL_PX 32u

struct marks {
    struct mark *at;
    uint32_t    *by_cell; /* indices */
    uint32_t    *cells;   /* where each begins in by_cell; one more ends the last */
    uint16_t    *relative_q8; /* size over the neighbourhood's median */
    uint32_t     count;
    uint32_t     size;
    unsigned     columns;
    unsigned     rows;
};

void marks_init(struct marks *marks, struct arena *arena, unsigned width, unsigned height);

/* ratio_q8: large over small radius on the target (2 at two levels). */
void marks_classify(const struct ellipses *ellipses, uint32_t ratio_q8, struct marks *out);

/* The marks whose centres lie in a square of half side `reach` around (x, y): up to `size` indices, in
 * the order of the grid. Returns how many; more than `size` are cut off. */
uint32_t marks_near(const struct marks *marks, int32_t x_px_q16, int32_t y_px_q16,
                    uint32_t reach_px_q16, uint32_t out[], uint32_t size);

#endif
