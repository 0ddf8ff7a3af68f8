/* Straight edges behind which triangles of both colours meet, as an anchor's do: what of the other colour the blur
 * brings to the near side.
 *
 * In blurs, with t the distance inside the edge and u that from a ray's line through the edge's middle, blur brings
 * Phi(-t) from behind the edge. Of it lies beyond the ray: the distance to its line, among what comes from
 * behind, has the mean u - g lambda and the variance 1 - g^2 lambda (lambda - t), with g the cosine between both
 * normals and lambda = phi(t) / Phi(-t) (the moments of a normal distribution cut at t; Johnson, Kotz and Balakrishnan,
 * Continuous Univariate Distributions, 1994, ch. 13.10); taken as normal, that is Phi of their quotient. At t
 * from 1.2 on its error is at most 0.0007 of the swing for g = 0.71 (rays at 45 degrees from the edge), 0.002 for
 * 0.86, 0.0055 for 0.95; at 2 blurs 0.0009 for 0.95. */
#ifndef TESSERA_FIRMWARE_DETECT_JUNCTION_H
#define TESSERA_FIRMWARE_DETECT_JUNCTION_H

#include <stdbool.h>
#include <stdint.h>

#define JUNCTION_RAYS 3u

/* A line over a circle's unit frame, in blurs: t0 + tp p + tq q. */
struct felt_line {
    int64_t t0_q16;
    int64_t tp_q16;
    int64_t tq_q16;
};

struct junction_ray {
    struct felt_line line;     /* positive beyond the ray */
    int32_t          lean_q15; /* the cosine between the ray's normal and the edge's */
    int32_t          step;     /* of the share of the other colour, on crossing it */
};

struct junction {
    struct felt_line    edge; /* positive on the near side */
    int32_t             first; /* 1: the other colour is on the near side of all rays; 0: the own */
    unsigned            ray_count;
    struct junction_ray rays[JUNCTION_RAYS];
};

/* Adds to *share_q15 what of the full swing the edge brings to unit-frame place (p, q), and to *growth_q15 how that
 * grows with the logarithm of the blur. False beyond the edge. */
bool junction_add(const struct junction *junction, int32_t p_q14, int32_t q_q14, int32_t *share_q15,
                  int32_t *growth_q15);

#endif
