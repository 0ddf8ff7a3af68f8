/* What is printed where: the triangles of the target around one feature, as straight edges in the image. */
#ifndef TESSERA_FIRMWARE_DETECT_PATTERN_H
#define TESSERA_FIRMWARE_DETECT_PATTERN_H

#include "common/target/target.h"
#include "firmware/detect/boardmap.h"

/* One patch in view. Without a target its place is (0, 0), unturned, and what lies beside it is not
 * known. */
struct pattern_patch {
    const struct target *target; /* may be NULL */
    uint8_t              levels;
    uint16_t             id;
    int32_t              row;
    int32_t              col;
    bool                 turned;
};

/* A ray from an edge's middle away from the feature, across which the print changes once more. Its normal points
 * to the edge's first corner. */
struct pattern_ray {
    int32_t nx_q15;
    int32_t ny_q15;
    int32_t step; /* +1: beyond it, towards the first corner, there is the other colour; -1: the feature's own */
};

/* A side of the feature's triangle: e(x, y) = nx (x - x0) + ny (y - y0), in pixels, positive on the feature's
 * side, (x0, y0) its middle. What lies behind it is of one colour, or of two that rays part. */
#define PATTERN_RAYS 3u
struct pattern_edge {
    int32_t            x_px_q16;
    int32_t            y_px_q16;
    int32_t            nx_q15;
    int32_t            ny_q15;
    bool               other; /* the colour at the second corner's end is not the feature's own */
    unsigned           ray_count;
    struct pattern_ray rays[PATTERN_RAYS];
};

struct pattern_edges {
    struct pattern_edge at[3];
    unsigned            count;
    bool                known; /* the colours on the other sides of all three edges are known */
    int32_t             x_px_q16; /* where the map has the feature's centre */
    int32_t             y_px_q16;
};

/* Board place, in patch sides, of a place in the patch's own frame. */
void pattern_to_board(const struct pattern_patch *patch, int64_t u_q24, int64_t v_q24,
                      int64_t *board_u_q24, int64_t *board_v_q24);

/* The edges of a feature's triangle behind which there is the other colour somewhere. The map is from the board
 * (pattern_to_board) to the image. */
void pattern_edges_of(const struct pattern_patch *patch, unsigned feature,
                      const struct boardmap *map, struct pattern_edges *out);

/* Moves the edges as far as the feature's centre was seen from where the map has it. */
void pattern_edges_move(struct pattern_edges *edges, int32_t x_px_q16, int32_t y_px_q16);

#endif
