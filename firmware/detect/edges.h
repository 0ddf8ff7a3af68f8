/* Rows of derivatives -> sub-pixel edge points: the zero crossings of the second derivative along
 * the gradient, where it goes from the dark to the bright side of an edge.
 *
 * Points lie on the lines of the pixel grid: between two neighbours of a row ("across") or of a
 * column ("down"). That makes linking a matter of grid cells (chains.h), and each point exact along
 * its line.
 *
 * The place between the two pixels is found on q = L_nn / |L_n|, the second over the first
 * derivative along the gradient n. On a straight step edge under Gaussian blur q is -(n - n0) / s^2:
 * exactly linear, so that linear interpolation has no bias, whatever the sub-pixel position; L_nn
 * itself would be off by 0.02 px. */
#ifndef TESSERA_FIRMWARE_DETECT_EDGES_H
#define TESSERA_FIRMWARE_DETECT_EDGES_H

#include "firmware/detect/steer.h"

/* One edge point. (0,0) is the centre of the top-left pixel. */
struct edge {
    int32_t  x_px_q16;
    int32_t  y_px_q16;
    uint32_t squares_q6; /* |gradient|^2, (grey_q4 a pixel)^2, the sum of the two pixels beside; below 2^31 */
    uint16_t column;     /* the pixel column at its left, or its own */
    /* Walking along the edge with the dark side on the left, this point is passed downwards (points
     * across a row) or rightwards (points down a column). */
    bool     forward;
};

/* The column of what is behind the last point of a list: higher than any. */
#define EDGES_END UINT16_MAX

/* Behind each list's last point is one in column EDGES_END. */
struct edge_row {
    struct edge *across;       /* on row y, between columns c and c + 1, by rising c */
    struct edge *down;         /* on column c, between rows y - 1 and y, by rising c */
    uint32_t     across_count; /* at most width - 1 */
    uint32_t     down_count;   /* at most width     */
};

static inline void edges_end_lists(struct edge_row *row)
{
    row->across[row->across_count].column = EDGES_END;
    row->down[row->down_count].column = EDGES_END;
}

void edges_init(struct edge_row *out, struct arena *arena, unsigned width);

/* The points of row y and of the gap above it. above is row y - 1, or NULL for row 0. */
void edges_scan_row(const struct dsp_gradient *above, const struct dsp_gradient *row, uint16_t y,
                    unsigned width, struct edge_row *out);

#endif
