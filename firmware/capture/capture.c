/* What all backends share: times, lost frames, and whose turn it is. */
#include "firmware/capture/capture.h"

#include <assert.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>

bool capture_say(struct capture *capture, const char *format, ...)
{
    va_list rest;
    va_start(rest, format);
    (void)vsnprintf(capture->sentence, sizeof capture->sentence, format, rest);
    va_end(rest);
    return false;
}

bool capture_open(struct capture *capture, const struct capture_options *options)
{
    assert(capture->backend != NULL);
    assert(options->device != NULL);
    capture->sentence[0] = '\0';
    capture->exposure_ns = options->exposure_ns;
    capture->row_time_ns = options->row_time_ns;
    capture->holds = false;
    return capture->backend->open(capture, options);
}

bool capture_start(struct capture *capture)
{
    capture->counters = (struct capture_counters){ 0 };
    capture->has_last = false;
    return capture->backend->start(capture);
}

static int64_t first_row_middle_ns(const struct capture *capture,
                                   const struct capture_arrival *arrival)
{
    const int64_t half_ns = capture->exposure_ns / 2;
    if (arrival->stamp_is_start) {
        return arrival->stamp_ns + half_ns;
    } else {
        const int64_t later_rows = capture->info.height_px - 1;
        return arrival->stamp_ns - later_rows * (int64_t)capture->row_time_ns - half_ns;
    }
}

/* A device may start at any number, and one that repeats itself or goes back tells nothing. */
static void count_gap(struct capture *capture, uint32_t sequence)
{
    const uint32_t step = sequence - capture->last_sequence;
    if (capture->has_last && step >= 2 && step < UINT32_C(1) << 31) {
        capture->counters.dropped += step - 1;
    }
    capture->last_sequence = sequence;
    capture->has_last = true;
}

enum capture_status capture_next(struct capture *capture, uint32_t timeout_ms,
                                 struct frame_view *out)
{
    assert(!capture->holds);
    struct capture_arrival arrival = { 0 };
    const enum capture_status status = capture->backend->next(capture, timeout_ms, &arrival);
    if (status != CAPTURE_FRAME) {
        return status;
    }
    count_gap(capture, arrival.sequence);
    if (arrival.broken) {
        capture->counters.broken++;
        capture->backend->release(capture);
        return CAPTURE_NONE;
    }
    capture->counters.frames++;
    capture->holds = true;
    *out = (struct frame_view){
        .pixels = arrival.pixels,
        .stride_bytes = capture->info.stride_bytes,
        .width_px = capture->info.width_px,
        .height_px = capture->info.height_px,
        .format = capture->info.format,
        .t_capture_ns = first_row_middle_ns(capture, &arrival),
        .sequence = arrival.sequence,
    };
    return CAPTURE_FRAME;
}

void capture_release(struct capture *capture)
{
    assert(capture->holds);
    capture->holds = false;
    capture->backend->release(capture);
}

void capture_close(struct capture *capture)
{
    capture->holds = false;
    capture->backend->close(capture);
}
