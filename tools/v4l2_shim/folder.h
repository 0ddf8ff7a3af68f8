/* A folder of frames: which files, in which order, of which format, taken when.
 *
 * Used by tessera-replay, to refuse a bad folder before the command starts, and by the shim, to
 * read the frames. Every failure is one sentence that names the file. */
#ifndef TESSERA_V4L2_SHIM_FOLDER_H
#define TESSERA_V4L2_SHIM_FOLDER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "tools/v4l2_shim/sentence.h"

/* A V4L2 pixel format with its size. */
struct folder_format {
    uint32_t fourcc;       /* V4L2_PIX_FMT_*                                      */
    uint32_t width_px;     /* 1..65535                                            */
    uint32_t height_px;    /* 1..65535                                            */
    uint32_t stride_bytes; /* V4L2's bytesperline: from one row to the next       */
    uint32_t image_bytes;  /* V4L2's sizeimage: what one frame delivers           */
};

struct folder_frame {
    char   *name;        /* file name inside the folder                           */
    int64_t t_ns;        /* capture time, middle of the first row's exposure      */
    int64_t exposure_ns; /* 0 where times.csv has no such column                  */
};

struct folder {
    char                *path;
    struct folder_format format;
    bool                 raw;     /* files hold V4L2's bytes; else they are PGM        */
    bool                 timed;   /* times.csv gave t_ns                               */
    int64_t              loop_ns; /* timed: what a second pass adds to every t_ns      */
    struct folder_frame *frames;  /* in natural name order                             */
    size_t               count;   /* at least 1                                        */
};

/* Fills stride (where 0) and image bytes from fourcc and size; false, with a sentence that does not
 * name a file, where format and size cannot go together. */
bool folder_complete_format(struct folder_format *format, char sentence[SENTENCE_BYTES]);

/* Looks at every file of the folder (headers and sizes, not pixels). raw is the files' format
 * where they are raw, NULL where they are PGM. On false, sentence says why and out
 * needs no close. */
bool folder_open(struct folder *out, const char *path, const struct folder_format *raw,
                 char sentence[SENTENCE_BYTES]);

/* Writes frame index as V4L2 delivers it: format.image_bytes bytes, samples little-endian. */
bool folder_read(const struct folder *folder, size_t index, uint8_t *to,
                 char sentence[SENTENCE_BYTES]);

void folder_close(struct folder *folder);

/* The order of names with their numbers taken as numbers: a2 before a10. Like strcmp. */
int folder_compare_names(const char *a, const char *b);

#endif
