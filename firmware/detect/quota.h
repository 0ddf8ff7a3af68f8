/* Bounds the edge points of a frame, and so what the stages behind them may cost: where there are too many, the
 * weakest edges are left out until there are few enough.
 *
 * No frame that shows a target comes near it (limits.h). Noise and fine patterns at full contrast do: they cost
 * several times a target, and hold nothing. Points are counted row by row; once more have come than rows times
 * their share and a reserve allow, each row asks for twice the gradient of the row before, and for half again
 * when they are within bounds. At most one reserve and a few rows more than the share are let through. */
#ifndef TESSERA_FIRMWARE_DETECT_QUOTA_H
#define TESSERA_FIRMWARE_DETECT_QUOTA_H

#include "firmware/detect/edges.h"

struct quota {
    uint64_t points;    /* so far                                                      */
    uint64_t allowed;   /* up to and with the last row                                 */
    uint64_t reserve;
    uint32_t row_share; /* points that a row may have, for long                        */
    uint32_t doublings; /* of the least gradient, 0..QUOTA_DOUBLINGS_MAX               */
    bool     reached;   /* edges were left out                                         */
};

/* Then no gradient is enough: the largest is below 2^15, the least that can be asked for is 1. */
#define QUOTA_DOUBLINGS_MAX 15u

void quota_begin(struct quota *quota, unsigned width, unsigned height);

/* Counts a row's points. */
void quota_count(struct quota *quota, const struct edge_row *edges);

/* The threshold of the next row, on the gradient's square: at most 2^30. */
uint32_t quota_threshold_q6(const struct quota *quota, uint32_t threshold_q6);

#endif
