/* What capture gives, one line a frame, for tests/system/test_capture.py: sequence, time, and the
 * checksum of the rows without their padding. Options: DEVICE COUNT [FORMAT [WIDTH HEIGHT]]. */
#include "firmware/capture/v4l2.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

/* FNV-1a of the frame's rows. */
static uint64_t digest(const struct frame_view *frame)
{
    uint64_t sum = UINT64_C(0xcbf29ce484222325);
    for (uint32_t y = 0; y < frame->height_px; y++) {
        const uint8_t *const row = frame->pixels + (size_t)y * frame->stride_bytes;
        const uint32_t bytes = frame_row_bytes(frame->format, frame->width_px);
        for (uint32_t x = 0; x < bytes; x++) {
            sum = (sum ^ row[x]) * UINT64_C(0x100000001b3);
        }
    }
    return sum;
}

int main(int argc, char **argv)
{
    static struct v4l2_camera camera;
    struct capture *const capture = v4l2_capture(&camera, &v4l2_sys_linux);
    const struct capture_options options = {
        .device = argv[1],
        .format = argc > 3 ? argv[3] : NULL,
        .width_px = argc > 5 ? (uint32_t)atoi(argv[4]) : 0,
        .height_px = argc > 5 ? (uint32_t)atoi(argv[5]) : 0,
    };
    if (!capture_open(capture, &options)) {
        (void)fprintf(stderr, "%s\n", capture->sentence);
        return 1;
    }
    if (!capture_start(capture)) {
        (void)fprintf(stderr, "%s\n", capture->sentence);
        capture_close(capture);
        return 1;
    }
    (void)printf("%s %d %u %u\n", capture->info.serial, (int)capture->info.format,
                 capture->info.width_px, capture->info.height_px);
    enum capture_status status = CAPTURE_NONE;
    for (int taken = 0; taken < atoi(argv[2]) && status <= CAPTURE_NONE;) {
        struct frame_view frame;
        status = capture_next(capture, 1000, &frame);
        if (status == CAPTURE_FRAME) {
            (void)printf("%" PRIu32 " %" PRId64 " %016" PRIx64 "\n", frame.sequence,
                         frame.t_capture_ns, digest(&frame));
            capture_release(capture);
            taken++;
        }
    }
    (void)printf("end %d frames %" PRIu64 " dropped %" PRIu64 " broken %" PRIu64 "\n", (int)status,
                 capture->counters.frames, capture->counters.dropped, capture->counters.broken);
    capture_close(capture);
    return 0;
}
