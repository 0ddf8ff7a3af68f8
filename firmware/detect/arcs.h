/* Parts of contours that bend one way, and the store of those that wait for the rest of their ellipse. */
#ifndef TESSERA_FIRMWARE_DETECT_ARCS_H
#define TESSERA_FIRMWARE_DETECT_ARCS_H

#include "firmware/detect/chains.h"

/* Points first .. first + count - 1 of a contour; of a closed one taken modulo its count. */
struct arcs_run {
    uint32_t first;
    uint32_t count;
};

#define ARCS_RUNS_MAX 64u

/* Cuts a contour into runs of at least `shortest` points that bend to one side, without corners and
 * without straight parts. The direction is measured over chords of `step` points: small steps follow small
 * circles, large ones see the bend of large circles through noise. At most ARCS_RUNS_MAX runs;
 * returns how many. */
uint32_t arcs_split(const struct contour *contour, uint32_t step, uint32_t shortest,
                    struct arcs_run out[ARCS_RUNS_MAX]);

/* An arc in the store, with the circle through its ends and middle. */
struct arc {
    uint32_t first;
    uint32_t count;
    int32_t  x_px_q16; /* that circle's centre */
    int32_t  y_px_q16;
    int32_t  radius_px_q16;
    uint16_t gradient_mean_q3;
    bool     white;
    bool     used;
};

struct arcs {
    struct arc *at;
    int32_t    *x_px_q16; /* the points of all arcs one after the other, and room for a contour */
    int32_t    *y_px_q16;
    uint32_t    count;
    uint32_t    size;
    uint32_t    points;
    uint32_t    points_size;
    bool        truncated;
};

void arcs_init(struct arcs *arcs, struct arena *arena, unsigned width, unsigned height);
void arcs_begin(struct arcs *arcs);

/* Keeps an arc. What is straight, or has no room, is dropped (the latter is reported). */
void arcs_keep(struct arcs *arcs, const int32_t x_px_q16[], const int32_t y_px_q16[],
               uint32_t count, uint16_t gradient_mean_q3);

/* Whether two arcs may be parts of one ellipse: same colour, circles of like size and place. Generous,
 * for an ellipse's ends bend more than its flanks: the fit of both together decides. */
bool arcs_may_join(const struct arc *a, const struct arc *b);

#endif
