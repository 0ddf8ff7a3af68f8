/* Every capacity of the detector in one place. Memory follows the frame's size: the caller hands over
 * one block of pipeline_bytes() (app/pipeline.h), and nothing is allocated later. A list that is
 * full drops what comes next and says so in the packet. */
#ifndef TESSERA_FIRMWARE_LIMITS_H
#define TESSERA_FIRMWARE_LIMITS_H

#include <assert.h>
#include <stdint.h>

/* Frames: 1x1 to 8192x8192. */
#define LIMIT_SIDE_PX 8192u

/* The longest contour kept whole, in edge points. A circle has about 8 points a pixel of radius, so
 * this is a circle of radius 500 px; what is longer is no feature and only its ends are followed. */
#define LIMIT_CONTOUR_POINTS 4096u

/* Edge points that a row may have, in the mean of many rows; beyond, the weakest edges are left out (quota.h).
 * Frames full of target were seen to have 0.17 a pixel where the smallest circles have 3 px radius, at three
 * levels 0.23; noise has 0.6, checks of 3 px 1.1. */
static inline uint32_t limit_edges_a_row(uint32_t width_px)
{
    return 64u + 5u * width_px / 16u;
}

/* Ellipses that may be fitted to contours and arcs, good ones or not. Frames full of target were seen to need one on
 * 210 pixels, at three levels one on 135; triangles side by side would have one on 40. */
static inline uint32_t limit_fits(uint32_t width_px, uint32_t height_px)
{
    return 1024u + (uint32_t)((uint64_t)width_px * height_px / 80u);
}

/* Edge points of contours that are still open while the frame is scanned: 16 bytes each. Lines of the
 * target stay open longest; frames full of target were seen to need 0.4 % of their pixels. */
static inline uint32_t limit_points(uint32_t width_px, uint32_t height_px)
{
    const uint32_t share = (uint32_t)((uint64_t)width_px * height_px / 100u);
    return share + 4u * width_px + 2u * LIMIT_CONTOUR_POINTS;
}

/* Ellipses a frame: 24 bytes each. A circle of radius 3 px has a patch of 58 px side to itself and
 * twelve others: one feature on 260 px. */
static inline uint32_t limit_ellipses(uint32_t width_px, uint32_t height_px)
{
    return 1024u + (uint32_t)((uint64_t)width_px * height_px / 160u);
}

/* Arcs that wait to be merged with other arcs of their ellipse, 24 bytes each, and their points, 8 bytes each.
 * Frames full of target were seen to need one on 4000 pixels: halves of the circles' inner rings. */
static inline uint32_t limit_arcs(uint32_t width_px, uint32_t height_px)
{
    return 512u + (uint32_t)((uint64_t)width_px * height_px / 2500u);
}

static inline uint32_t limit_arc_points(uint32_t width_px, uint32_t height_px)
{
    return 32u * limit_arcs(width_px, height_px);
}

/* Neighbours of anchors whose place on a patch may be computed. Frames full of target were seen to need one on 20
 * pixels, at three levels one on 10; what is put together of large and small circles but is no target, one on one. */
static inline uint32_t limit_looks(uint32_t width_px, uint32_t height_px)
{
    return 16384u + (uint32_t)((uint64_t)width_px * height_px / 3u);
}

/* Patches a frame: there are no more ids. */
#define LIMIT_PATCHES 4096u

#endif
