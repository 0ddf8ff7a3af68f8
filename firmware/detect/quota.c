/* See quota.h. */
#include "firmware/detect/quota.h"

#include "firmware/limits.h"

/* The share of this part of the frame's rows may come at once. */
#define RESERVE_PART 8u
#define THRESHOLD_MAX_Q6 ((uint64_t)1 << 30)

void quota_begin(struct quota *quota, unsigned width, unsigned height)
{
    *quota = (struct quota){.row_share = limit_edges_a_row(width)};
    quota->reserve = (uint64_t)quota->row_share * height / RESERVE_PART;
    quota->allowed = quota->reserve;
}

void quota_count(struct quota *quota, const struct edge_row *edges)
{
    quota->points += edges->across_count + edges->down_count;
    quota->allowed += quota->row_share;
    if (quota->points > quota->allowed) {
        quota->reached = true;
        quota->doublings += quota->doublings < QUOTA_DOUBLINGS_MAX ? 1 : 0;
    } else if (quota->doublings > 0 && quota->points + quota->reserve / 4 < quota->allowed) {
        quota->doublings--;
    }
}

uint32_t quota_threshold_q6(const struct quota *quota, uint32_t threshold_q6)
{
    const uint64_t raised = (uint64_t)threshold_q6 << (2 * quota->doublings);
    return (uint32_t)(raised < THRESHOLD_MAX_Q6 ? raised : THRESHOLD_MAX_Q6);
}
