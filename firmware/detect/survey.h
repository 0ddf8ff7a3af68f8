/* Which parts of a frame have edges, and whether the patches that were named explain them all.
 *
 * A frame is first looked at in half its size, which costs a quarter and finds circles of 5 px radius and more.
 * Where edges are left that belong to no patch found so, there may be smaller ones, and the frame is looked at
 * in full. */
#ifndef TESSERA_FIRMWARE_DETECT_SURVEY_H
#define TESSERA_FIRMWARE_DETECT_SURVEY_H

#include "firmware/detect/patches.h"

/* Cells of the frame at half its size. */
#define SURVEY_CELL_PX 32u

struct survey {
    uint16_t *edges;   /* by cell: points across its rows, saturated; 0 once explained */
    unsigned  columns;
    unsigned  rows;
};

void survey_init(struct survey *survey, struct arena *arena, unsigned width, unsigned height);
void survey_begin(struct survey *survey);

/* Counts the points of row y of the frame at half its size. */
void survey_count(struct survey *survey, const struct edge_row *edges, unsigned y);

/* Takes away what lies around the features of these patches, three quarters of a patch's side in x and y: so
 * far the target reaches, with its margin. */
void survey_explain(struct survey *survey, const struct patches *patches, const struct marks *marks);

/* Cells with edges enough for a part of a patch. */
uint32_t survey_left(const struct survey *survey);

/* Whether many of the first `classified` marks look like anchors and have no named circle in their place: more
 * than an eighth of those that have one. */
bool survey_misses_anchors(const struct marks *marks, uint32_t classified);

#endif
