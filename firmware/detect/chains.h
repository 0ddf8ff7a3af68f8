/* Edge points -> contours, while the image is scanned: only contours that are still open are kept.
 *
 * The zero crossings cut the grid cells like the level lines of a bilinear surface: a contour enters
 * a cell through one crossing and leaves through another. With the dark side always on the left, each
 * crossing is an entrance to one of the two cells that share it and an exit of the other, so contours
 * are singly linked lists in one direction, and joining two is O(1).
 *
 * A contour is finished when neither of its ends can grow any more. Then it waits for chains_take. */
#ifndef TESSERA_FIRMWARE_DETECT_CHAINS_H
#define TESSERA_FIRMWARE_DETECT_CHAINS_H

#include "firmware/detect/edges.h"

#define CHAINS_NONE UINT32_MAX

struct chain_point {
    int32_t  x_px_q16;
    int32_t  y_px_q16;
    uint32_t next;  /* index of the next point with the dark side on the left; of a contour's last point: any */
    uint32_t chain; /* its contour; only true at a contour's two ends                          */
};

struct chain {
    uint32_t head;
    uint32_t tail;
    uint32_t count; /* points; of more than LIMIT_CONTOUR_POINTS only the two ends are kept */
    uint32_t open;  /* points whose second cell has not been looked at */
    uint64_t squares_q6; /* the sum of its points' */
    bool     closed;
};

/* A point whose second cell comes later. */
struct chain_end {
    uint32_t point;   /* CHAINS_NONE: no such point */
    uint16_t column;
    bool     forward; /* as in struct edge */
};

struct chains {
    struct chain_point *points;
    struct chain       *chains;
    uint32_t           *finished;        /* indices of contours, in the order they ended   */
    struct chain_end   *top;             /* the points across row y - 1, by rising column, and an EDGES_END */
    struct chain_end   *bottom;          /* those across row y                             */
    uint32_t            points_size;
    uint32_t            chains_size;
    uint32_t            points_free;     /* heads of the free lists, linked by next / head */
    uint32_t            chains_free;
    uint32_t            finished_count;
    uint32_t            finished_taken;
    uint32_t            top_count;
    uint32_t            points_used;
    uint32_t            points_used_max; /* the most that rows of the frame ended with */
    bool                truncated;       /* a point had to be dropped: no room             */
};

/* A finished contour, copied out: points in order, dark side on the left. */
struct contour {
    int32_t *x_px_q16;         /* LIMIT_CONTOUR_POINTS each */
    int32_t *y_px_q16;
    uint32_t count;
    uint16_t gradient_mean_q3; /* root mean square of |gradient| at all points' pixels */
    bool     closed;
};

void chains_init(struct chains *chains, struct arena *arena, unsigned width, unsigned height);
void chains_begin(struct chains *chains);

/* Links the points of row y and of the gap above it; rows in order. */
void chains_link_row(struct chains *chains, const struct edge_row *edges, bool first_row);

/* No more rows: every contour that is left is finished. */
void chains_end(struct chains *chains);

/* Copies the next finished contour of at least `shortest` points out and frees it; shorter ones and
 * overlong ones are freed on the way. False when none is left for now. */
bool chains_take(struct chains *chains, uint32_t shortest, struct contour *out);

#endif
