/* Cameras through V4L2: single-planar capture into mapped buffers. */
#ifndef TESSERA_FIRMWARE_CAPTURE_V4L2_H
#define TESSERA_FIRMWARE_CAPTURE_V4L2_H

#include "firmware/capture/capture.h"
#include "firmware/capture/v4l2_sys.h"

#include <stddef.h>

enum { V4L2_BUFFERS_MAX = 32 };

/* All fields are the module's own; base is for the functions of capture.h. */
struct v4l2_camera {
    struct capture         base; /* first: a struct capture * is this struct's address */
    const struct v4l2_sys *sys;
    const char            *device;
    int                    fd;
    uint32_t               frame_bytes; /* a buffer with fewer is short */
    uint32_t               buffer_count;
    uint32_t               held;         /* index of the buffer that next() handed out */
    uint32_t               faults;       /* in a row, of the kind that may pass */
    int                    queue_error;  /* errno value of a release that failed; 0: none */
    struct {
        const uint8_t *memory;
        size_t         bytes;
    } buffers[V4L2_BUFFERS_MAX];
};

/* Makes camera ready for capture_open, which takes its device from the options. sys is
 * &v4l2_sys_linux. */
struct capture *v4l2_capture(struct v4l2_camera *camera, const struct v4l2_sys *sys);

#endif
