/* The header of a binary greyscale image (PGM, P5). */
#ifndef TESSERA_V4L2_SHIM_PGM_HEAD_H
#define TESSERA_V4L2_SHIM_PGM_HEAD_H

#include <stdint.h>
#include <stdio.h>

struct pgm_head {
    uint32_t width_px;
    uint32_t height_px;
    uint32_t maxval;        /* 1..65535; above 255 a sample has two bytes, the high one first */
    uint32_t pixels_offset; /* of the first pixel in the file, bytes                          */
};

/* Reads the header and leaves the file at the first pixel. NULL, or what is wrong. */
const char *pgm_head_read(FILE *file, struct pgm_head *out);

#endif
