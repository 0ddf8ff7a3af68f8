/* What raw frames are: a folder's format.json. */
#ifndef TESSERA_V4L2_SHIM_RAW_KIND_H
#define TESSERA_V4L2_SHIM_RAW_KIND_H

#include "tools/v4l2_shim/folder.h"

/* Reads `{"fourcc": "YUYV", "width": 640, "height": 480}`, perhaps with "bytesperline". The fourcc
 * is one of GREY, Y10, Y12, Y16, YUYV, UYVY, NV12, and may also be called "format" or
 * "pixelformat".
 * There is none where path does not exist: then *found is false. */
bool raw_kind_read(const char *path, struct folder_format *out, bool *found,
                   char sentence[SENTENCE_BYTES]);

#endif
