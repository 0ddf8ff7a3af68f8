/* Any pixel format -> rows of luma in one scale: grey levels of an 8-bit camera with 4 fractional
 * bits (grey_q4, 0..4095), so that every later stage has one unit. */
#ifndef TESSERA_FIRMWARE_DETECT_LUMA_H
#define TESSERA_FIRMWARE_DETECT_LUMA_H

#include "firmware/frame.h"

#include <stddef.h>

/* Writes row y (0 <= y < height) of the frame into out_grey_q4: width_px values, and `pad` copies of
 * the first and of the last value before and after them. `out_grey_q4` points at the first
 * value, with room for the copies on both sides.
 * Range: 0..4095. 8 bit: times 16; 10 bit: times 4; 12 bit: as it is; 16 bit: divided by 16, truncated.
 * Samples above the format's maximum are taken as the maximum. */
void luma_row(const struct frame_view *frame, uint16_t y, unsigned pad, uint16_t *out_grey_q4);

/* The copies alone: of the first and the last of `width` values. */
void luma_pad(unsigned width, unsigned pad, uint16_t *grey_q4);

/* Row y (0 <= y < height / 2) of the frame at half its size: means of four pixels, rounded, width / 2 of them. */
void luma_halved_row(const struct frame_view *frame, uint16_t y, uint16_t *out_grey_q4);

/* The same as luma_row for `count` pixels of row y from column x on, all inside the frame, without copies. */
void luma_span(const struct frame_view *frame, uint16_t y, uint16_t x, unsigned count,
               uint16_t *out_grey_q4);

#endif
