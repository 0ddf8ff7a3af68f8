/* The capture times of a folder's frames: times.csv. */
#ifndef TESSERA_V4L2_SHIM_TIMES_CSV_H
#define TESSERA_V4L2_SHIM_TIMES_CSV_H

#include "tools/v4l2_shim/folder.h"

/* Header line `file,t_ns`, perhaps with more columns, of which `exposure_ns` is known; then a row
 * a file, in any order. Every frame needs a row; rows of other files are left alone, so that a
 * part of a recording can be replayed. frames must be in natural name order. */
bool times_csv_read(const char *path, struct folder_frame *frames, size_t count,
                    char sentence[SENTENCE_BYTES]);

#endif
