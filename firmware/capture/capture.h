/* Frames from a camera, whatever drives it: open, start, then next and release in turn, close.
 *
 * A backend (v4l2.h) is a table of functions behind a struct that begins with a struct capture.
 * What is the same for all of them lives here: when the first row was exposed, which frames were
 * lost. Nothing is allocated from the heap, and one thread uses a capture. */
#ifndef TESSERA_FIRMWARE_CAPTURE_CAPTURE_H
#define TESSERA_FIRMWARE_CAPTURE_CAPTURE_H

#include "firmware/frame.h"

#include <stdbool.h>
#include <stdint.h>

enum { CAPTURE_SERIAL_BYTES = 33, CAPTURE_SENTENCE_BYTES = 768 };

struct capture_options {
    const char *device;      /* such as /dev/video0                                               */
    const char *serial;      /* the camera's name; NULL: what the device says of itself           */
    const char *format;      /* GREY, Y10, Y12, Y16, YUYV, UYVY or NV12; NULL: the device's own,
                              * or the first that it offers of these                              */
    uint32_t    width_px;    /* with height_px; 0: the device's own                               */
    uint32_t    height_px;
    uint32_t    buffers;     /* 2..32; 0: 4                                                       */
    uint32_t    exposure_ns; /* known exposure time, for t_capture_ns; 0: unknown, taken as none  */
    uint32_t    row_time_ns; /* rolling shutter: from row to row; 0: global shutter or unknown    */
};

enum capture_clock {
    CAPTURE_CLOCK_UNKNOWN,
    CAPTURE_CLOCK_MONOTONIC, /* this machine's CLOCK_MONOTONIC */
};

/* Valid between a good capture_open and capture_close. */
struct capture_info {
    char               serial[CAPTURE_SERIAL_BYTES]; /* 1..32 printable bytes and a zero */
    enum frame_format  format;
    uint16_t           width_px;
    uint16_t           height_px;
    uint32_t           stride_bytes;
    enum capture_clock clock;
};

/* Since start. */
struct capture_counters {
    uint64_t frames;  /* handed out                                                  */
    uint64_t dropped; /* gaps in the device's sequence: frames that never came       */
    uint64_t broken;  /* came short or marked as faulty, and were not handed out     */
};

enum capture_status {
    CAPTURE_FRAME,     /* there is one; release it                                     */
    CAPTURE_NONE,      /* none in that time, or a signal, or a broken one was skipped  */
    CAPTURE_ENDED,     /* the stream has ended in good order                           */
    CAPTURE_UNPLUGGED, /* the device has gone                                          */
    CAPTURE_FAILED,    /* it cannot go on; the last three leave a sentence             */
};

/* One buffer as a backend got it from its device. */
struct capture_arrival {
    const uint8_t *pixels;
    uint32_t       sequence;
    int64_t        stamp_ns;
    bool           stamp_is_start; /* of the first row's exposure; else the end of the read-out */
    bool           broken;         /* the rest but sequence means nothing                       */
};

struct capture;

/* What a backend does. Each function that can fail writes the sentence. */
struct capture_backend {
    bool (*open)(struct capture *capture, const struct capture_options *options);
    bool (*start)(struct capture *capture);
    /* On CAPTURE_FRAME the arrival is the caller's until release, broken or not. */
    enum capture_status (*next)(struct capture *capture, uint32_t timeout_ms,
                                struct capture_arrival *out);
    void (*release)(struct capture *capture);
    void (*close)(struct capture *capture);
};

/* Read info, counters and sentence; the rest is the module's own. */
struct capture {
    const struct capture_backend *backend;
    struct capture_info           info;
    struct capture_counters       counters;
    char                          sentence[CAPTURE_SENTENCE_BYTES]; /* the last failure */
    uint32_t                      exposure_ns;
    uint32_t                      row_time_ns;
    uint32_t                      last_sequence;
    bool                          has_last;
    bool                          holds; /* a frame is out */
};

/* Opens the device and settles its format. False: see sentence, and there is nothing to close. */
bool capture_open(struct capture *capture, const struct capture_options *options);

/* Starts the stream and zeroes the counters. False: see sentence; close it. */
bool capture_start(struct capture *capture);

/* Waits up to timeout_ms (0: not at all) for a frame. On CAPTURE_FRAME the view is borrowed until
 * capture_release, which must come before the next capture_next.
 *
 * t_capture_ns is the middle of the first row's exposure. From a stamp of the exposure's start that
 * is stamp + exposure / 2. A stamp of the frame's end comes when the last row has been read out,
 * which is (height - 1) row times after the first row's exposure has ended, so it is
 * stamp - (height - 1) * row_time - exposure / 2; the transfer's own delay, which no driver tells,
 * stays in it. */
enum capture_status capture_next(struct capture *capture, uint32_t timeout_ms,
                                 struct frame_view *out);

/* Gives the frame back. */
void capture_release(struct capture *capture);

void capture_close(struct capture *capture);

/* Writes the sentence; false, so that a failing check can end with it. */
__attribute__((format(printf, 2, 3))) bool capture_say(struct capture *capture, const char *format,
                                                       ...);

#endif
