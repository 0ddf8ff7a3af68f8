/* Image files -> frames: PGM (P5, 8 and 16 bit) and PNG. */
#ifndef TESSERA_FIRMWARE_APP_IMAGE_FILE_H
#define TESSERA_FIRMWARE_APP_IMAGE_FILE_H

#include <stdbool.h>

#include "firmware/frame.h"

#define IMAGE_FILE_ERROR_BYTES 512

/* An image in memory; `frame` looks into `pixels`. */
struct image_file {
    uint8_t          *pixels;
    struct frame_view frame;
};

/* Reads a file; which kind is told by its first bytes. 16-bit PGM: maxval 1023, 4095 and 65535 become
 * GREY10, GREY12 and GREY16. PNG: 8 or 16 bit, colour turned to grey, transparency ignored. Sides up to
 * LIMIT_SIDE_PX. On failure false, with one sentence that names the file. Free with image_file_free. */
bool image_file_read(const char *path, struct image_file *out, char error[IMAGE_FILE_ERROR_BYTES]);

void image_file_free(struct image_file *image);

#endif
