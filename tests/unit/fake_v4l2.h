/* A scripted V4L2 device for the tests of capture: every answer can be made odd, every call can
 * fail.
 *
 * Included once by a test program, which gets its setUp() from here. */
#ifndef TESSERA_TESTS_UNIT_FAKE_V4L2_H
#define TESSERA_TESTS_UNIT_FAKE_V4L2_H

#include "firmware/capture/v4l2.h"

#include "unity.h"

#include <errno.h>
#include <linux/videodev2.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

enum { MEMORY_BYTES = 4096, ARRIVALS_MAX = 16 };

/* What DQBUF gives, in turn. */
struct arrival {
    int      error; /* errno value, or 0 and the rest counts */
    uint32_t sequence;
    int64_t  t_us;
    uint32_t flags;
    uint32_t bytes_used;
};

static struct {
    int                    open_error;
    struct v4l2_capability device;
    uint32_t               offered[8];
    uint32_t               offered_count;
    struct v4l2_pix_format pix; /* the present format */
    uint32_t               fixed_width;
    uint32_t               fixed_height;
    uint32_t               pretend_fourcc; /* S_FMT answers this, when not 0 */
    uint32_t               pretend_stride;
    uint32_t               buffers_given; /* 0: as many as asked */
    uint32_t               buffer_bytes;
    uint32_t               buffer_flags;
    uint32_t               dequeued_index; /* added to the right index */
    struct arrival         arrivals[ARRIVALS_MAX];
    uint32_t               arrival_count;
    uint32_t               arrival_next;
    int                    wait_answer;
    uint64_t               queued; /* a bit a buffer */
    uint32_t               next_index;
    bool                   streaming;
    int                    calls;
    int                    fail_call; /* this one fails, counted from 1; 0: none */
    int                    fail_error;
    int                    open_count;
    int                    mapped;
    uint8_t                memory[V4L2_BUFFERS_MAX][MEMORY_BYTES];
} fake;

static struct v4l2_camera camera;

/* True when this call was chosen to fail. */
static bool fails(void)
{
    fake.calls++;
    return fake.calls == fake.fail_call;
}

static int fake_open(const char *path)
{
    TEST_ASSERT_EQUAL_STRING("/dev/video7", path);
    if (fails()) {
        return -fake.fail_error;
    }
    if (fake.open_error != 0) {
        return -fake.open_error;
    }
    fake.open_count++;
    return 5;
}

static int enumerate(struct v4l2_fmtdesc *io)
{
    if (io->index >= fake.offered_count) {
        return -EINVAL;
    }
    io->pixelformat = fake.offered[io->index];
    return 0;
}

static int enumerate_size(struct v4l2_frmsizeenum *io)
{
    if (io->index >= 2) {
        return -EINVAL;
    }
    io->type = V4L2_FRMSIZE_TYPE_DISCRETE;
    io->discrete.width = io->index == 0 ? 16 : 32;
    io->discrete.height = io->index == 0 ? 8 : 16;
    return 0;
}

static int set_format(struct v4l2_format *io)
{
    struct v4l2_pix_format *const pix = &io->fmt.pix;
    if (fake.fixed_width != 0) {
        pix->width = fake.fixed_width;
        pix->height = fake.fixed_height;
    }
    if (fake.pretend_fourcc != 0) {
        pix->pixelformat = fake.pretend_fourcc;
    }
    pix->bytesperline = fake.pretend_stride;
    pix->field = fake.pix.field;
    return 0;
}

static int query_buffer(struct v4l2_buffer *io)
{
    io->length = fake.buffer_bytes;
    io->m.offset = io->index * MEMORY_BYTES;
    io->flags = fake.buffer_flags;
    return 0;
}

static int queue_buffer(const struct v4l2_buffer *io)
{
    TEST_ASSERT_EQUAL_UINT32(V4L2_MEMORY_MMAP, io->memory);
    TEST_ASSERT_TRUE_MESSAGE((fake.queued & (UINT64_C(1) << io->index)) == 0, "queued twice");
    fake.queued |= UINT64_C(1) << io->index;
    return 0;
}

static int dequeue_buffer(struct v4l2_buffer *io)
{
    if (!fake.streaming) {
        return -EINVAL;
    }
    if (fake.arrival_next >= fake.arrival_count) {
        return -EAGAIN;
    }
    const struct arrival *const arrival = &fake.arrivals[fake.arrival_next++];
    if (arrival->error != 0) {
        return -arrival->error;
    }
    while ((fake.queued & (UINT64_C(1) << fake.next_index)) == 0) {
        fake.next_index = (fake.next_index + 1) % V4L2_BUFFERS_MAX;
    }
    fake.queued &= ~(UINT64_C(1) << fake.next_index);
    io->index = fake.next_index + fake.dequeued_index;
    fake.next_index = (fake.next_index + 1) % V4L2_BUFFERS_MAX;
    io->sequence = arrival->sequence;
    io->timestamp.tv_sec = arrival->t_us / 1000000;
    io->timestamp.tv_usec = arrival->t_us % 1000000;
    io->flags = arrival->flags;
    io->bytesused = arrival->bytes_used;
    return 0;
}

static int fake_ioctl(int fd, unsigned long request, void *argument)
{
    TEST_ASSERT_EQUAL_INT(5, fd);
    /* The ends of two lists, and a stream that is closed anyway, may fail without a word. */
    if (request != VIDIOC_ENUM_FMT && request != VIDIOC_ENUM_FRAMESIZES &&
        request != VIDIOC_STREAMOFF && fails()) {
        return -fake.fail_error;
    }
    switch (request) {
    case VIDIOC_QUERYCAP:
        *(struct v4l2_capability *)argument = fake.device;
        return 0;
    case VIDIOC_ENUM_FMT:
        return enumerate(argument);
    case VIDIOC_ENUM_FRAMESIZES:
        return enumerate_size(argument);
    case VIDIOC_G_FMT:
        ((struct v4l2_format *)argument)->fmt.pix = fake.pix;
        return 0;
    case VIDIOC_S_FMT:
        return set_format(argument);
    case VIDIOC_REQBUFS:
        if (fake.buffers_given != 0) {
            ((struct v4l2_requestbuffers *)argument)->count = fake.buffers_given;
        }
        return 0;
    case VIDIOC_QUERYBUF:
        return query_buffer(argument);
    case VIDIOC_QBUF:
        return queue_buffer(argument);
    case VIDIOC_DQBUF:
        return dequeue_buffer(argument);
    case VIDIOC_STREAMON:
        fake.streaming = true;
        return 0;
    case VIDIOC_STREAMOFF:
        fake.streaming = false;
        fake.queued = 0;
        return 0;
    default:
        return -ENOTTY;
    }
}

static int fake_wait(int fd, uint32_t timeout_ms)
{
    TEST_ASSERT_EQUAL_INT(5, fd);
    (void)timeout_ms;
    return fails() ? -fake.fail_error : fake.wait_answer;
}

static int fake_map(int fd, uint32_t offset, size_t bytes, const uint8_t **out)
{
    TEST_ASSERT_EQUAL_INT(5, fd);
    TEST_ASSERT_TRUE(bytes <= MEMORY_BYTES);
    if (fails()) {
        return -fake.fail_error;
    }
    fake.mapped++;
    *out = fake.memory[offset / MEMORY_BYTES];
    return 0;
}

static void fake_unmap(const uint8_t *memory, size_t bytes)
{
    (void)memory;
    (void)bytes;
    fake.mapped--;
}

static void fake_close(int fd)
{
    TEST_ASSERT_EQUAL_INT(5, fd);
    fake.open_count--;
}

static const char *fake_error_text(int error)
{
    return error == EIO ? "Input/output error" : "some reason";
}

static const struct v4l2_sys fake_sys = {
    .open = fake_open,
    .ioctl = fake_ioctl,
    .wait = fake_wait,
    .map = fake_map,
    .unmap = fake_unmap,
    .close = fake_close,
    .error_text = fake_error_text,
};

static const struct capture_options plain = { .device = "/dev/video7" };

/* A well-behaved camera: 16 x 8 GREY with frames at 1.0 s, 1.04 s, ... */
void setUp(void)
{
    memset(&fake, 0, sizeof fake);
    fake.wait_answer = 1;
    fake.device.capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
    (void)snprintf((char *)fake.device.card, sizeof fake.device.card, "Some Camera");
    (void)snprintf((char *)fake.device.bus_info, sizeof fake.device.bus_info, "usb-1.2");
    fake.offered[0] = V4L2_PIX_FMT_YUYV;
    fake.offered[1] = V4L2_PIX_FMT_GREY;
    fake.offered_count = 2;
    fake.pix = (struct v4l2_pix_format){ .width = 16,
                                         .height = 8,
                                         .pixelformat = V4L2_PIX_FMT_GREY,
                                         .field = V4L2_FIELD_NONE };
    fake.buffer_bytes = MEMORY_BYTES;
    fake.buffer_flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
    for (uint32_t i = 0; i < ARRIVALS_MAX; i++) {
        fake.arrivals[i] = (struct arrival){ .sequence = i,
                                             .t_us = 1000000 + 40000 * (int64_t)i,
                                             .flags = fake.buffer_flags,
                                             .bytes_used = 128 };
    }
    fake.arrival_count = ARRIVALS_MAX;
}

void tearDown(void)
{
}

static struct capture *fresh(void)
{
    return v4l2_capture(&camera, &fake_sys);
}

static struct capture *started(const struct capture_options *options)
{
    struct capture *const capture = fresh();
    TEST_ASSERT_TRUE_MESSAGE(capture_open(capture, options), capture->sentence);
    TEST_ASSERT_TRUE_MESSAGE(capture_start(capture), capture->sentence);
    return capture;
}

#endif
