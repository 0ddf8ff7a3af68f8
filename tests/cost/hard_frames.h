/* Frames made to be slow, of any size, beside the frames full of target that they are held against. */
#ifndef TESSERA_TESTS_COST_HARD_FRAMES_H
#define TESSERA_TESTS_COST_HARD_FRAMES_H

#include "firmware/app/pipeline.h"

/* NULL from the number of frames on. */
const char *hard_frames_name(unsigned index);

/* The frame that a camera with the settings of frame `index` sees on a good day: a target's patches of 130 px side
 * over the whole frame, with the target's file. Itself where it is such a frame. */
unsigned hard_frames_normal(unsigned index);

/* What frame `index` is to be detected with; its target is this module's, until the next call of either function. */
void hard_frames_set(unsigned index, unsigned width_px, unsigned height_px,
                     struct pipeline_settings *settings);

/* Draws frame `index` into width * height bytes of grey. */
void hard_frames_draw(unsigned index, unsigned width_px, unsigned height_px, uint8_t *grey);

#endif
