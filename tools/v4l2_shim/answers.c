/* One function an ioctl, and a table of them.
 *
 * The order of checks is V4L2's own, and v4l2-compliance insists on it: an unknown request is
 * ENOTTY before its argument is looked at, a known one with a bad pointer is EFAULT. */
#include "tools/v4l2_shim/answers.h"

#include <errno.h>
#include <linux/videodev2.h>
#include <linux/version.h>
#include <stdio.h>
#include <string.h>

#include "tools/v4l2_shim/user_memory.h"
#include "tools/v4l2_shim/vqueue.h"

static const struct folder *shown;
static struct v4l2_fract interval; /* between frames, s */

void answers_start(const struct folder *folder, int64_t period_ns)
{
    shown = folder;
    if (period_ns == 0) {
        interval = (struct v4l2_fract){.numerator = 1, .denominator = 30};
    } else if (1000000000 % period_ns == 0) {
        interval = (struct v4l2_fract){.numerator = 1,
                                       .denominator = (uint32_t)(1000000000 / period_ns)};
    } else {
        /* In microseconds, because nanoseconds overflow at a frame in five seconds. */
        interval = (struct v4l2_fract){.numerator = (uint32_t)(period_ns / 1000),
                                       .denominator = 1000000};
    }
}

/* ---- what the device is ---- */

/* The folder's own name, in the characters that a device may have in its name. */
static void folder_name(char *to, size_t bytes)
{
    const char *const slash = strrchr(shown->path, '/');
    (void)snprintf(to, bytes, "%s", slash == NULL ? shown->path : slash + 1);
    for (char *c = to; *c != '\0'; c++) {
        if (*c <= ' ' || *c > '~') {
            *c = '_';
        }
    }
}

static int query_capabilities(struct opening *by, void *argument)
{
    (void)by;
    struct v4l2_capability *const io = argument;
    memset(io, 0, sizeof *io);
    char name[22];
    folder_name(name, sizeof name);
    (void)snprintf((char *)io->driver, sizeof io->driver, "tessera-shim");
    (void)snprintf((char *)io->card, sizeof io->card, "%s", name);
    (void)snprintf((char *)io->bus_info, sizeof io->bus_info, "platform:%s", name);
    io->version = KERNEL_VERSION(6, 1, 0);
    io->device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING | V4L2_CAP_EXT_PIX_FORMAT;
    io->capabilities = io->device_caps | V4L2_CAP_DEVICE_CAPS;
    return 0;
}

static int get_priority(struct opening *by, void *argument)
{
    (void)by;
    *(uint32_t *)argument = opens_priority();
    return 0;
}

static int set_priority(struct opening *by, void *argument)
{
    const uint32_t wanted = *(const uint32_t *)argument;
    if (wanted < V4L2_PRIORITY_BACKGROUND || wanted > V4L2_PRIORITY_RECORD) {
        return EINVAL;
    }
    by->priority = wanted;
    return 0;
}

static int enumerate_input(struct opening *by, void *argument)
{
    (void)by;
    struct v4l2_input *const io = argument;
    if (io->index != 0) {
        return EINVAL;
    }
    *io = (struct v4l2_input){.name = "Folder of frames", .type = V4L2_INPUT_TYPE_CAMERA};
    return 0;
}

static int get_input(struct opening *by, void *argument)
{
    (void)by;
    *(int *)argument = 0;
    return 0;
}

static int set_input(struct opening *by, void *argument)
{
    (void)by;
    return *(const int *)argument == 0 ? 0 : EINVAL;
}

/* ---- formats: there is exactly one ---- */

static const char *describe_format(uint32_t fourcc)
{
    switch (fourcc) {
    case V4L2_PIX_FMT_GREY:
        return "8-bit Greyscale";
    case V4L2_PIX_FMT_Y10:
        return "10-bit Greyscale";
    case V4L2_PIX_FMT_Y12:
        return "12-bit Greyscale";
    case V4L2_PIX_FMT_Y16:
        return "16-bit Greyscale";
    case V4L2_PIX_FMT_YUYV:
        return "YUYV 4:2:2";
    case V4L2_PIX_FMT_UYVY:
        return "UYVY 4:2:2";
    default:
        return "Y/CbCr 4:2:0";
    }
}

static int enumerate_format(struct opening *by, void *argument)
{
    (void)by;
    struct v4l2_fmtdesc *const io = argument;
    if (io->type != V4L2_BUF_TYPE_VIDEO_CAPTURE || io->index != 0) {
        return EINVAL;
    }
    *io = (struct v4l2_fmtdesc){.type = V4L2_BUF_TYPE_VIDEO_CAPTURE,
                                .pixelformat = shown->format.fourcc};
    (void)snprintf((char *)io->description, sizeof io->description, "%s",
                   describe_format(io->pixelformat));
    return 0;
}

static int enumerate_size(struct opening *by, void *argument)
{
    (void)by;
    struct v4l2_frmsizeenum *const io = argument;
    if (io->index != 0 || io->pixel_format != shown->format.fourcc) {
        return EINVAL;
    }
    *io = (struct v4l2_frmsizeenum){
        .pixel_format = shown->format.fourcc,
        .type = V4L2_FRMSIZE_TYPE_DISCRETE,
        .discrete = {.width = shown->format.width_px, .height = shown->format.height_px},
    };
    return 0;
}

static int enumerate_interval(struct opening *by, void *argument)
{
    (void)by;
    struct v4l2_frmivalenum *const io = argument;
    const struct folder_format *const format = &shown->format;
    if (io->index != 0 || io->pixel_format != format->fourcc || io->width != format->width_px ||
        io->height != format->height_px) {
        return EINVAL;
    }
    *io = (struct v4l2_frmivalenum){
        .pixel_format = format->fourcc,
        .width = format->width_px,
        .height = format->height_px,
        .type = V4L2_FRMIVAL_TYPE_DISCRETE,
        .discrete = interval,
    };
    return 0;
}

static int get_format(struct opening *by, void *argument)
{
    (void)by;
    struct v4l2_format *const io = argument;
    const struct folder_format *const format = &shown->format;
    if (io->type != V4L2_BUF_TYPE_VIDEO_CAPTURE) {
        return EINVAL;
    }
    *io = (struct v4l2_format){
        .type = V4L2_BUF_TYPE_VIDEO_CAPTURE,
        .fmt.pix = {.width = format->width_px,
                    .height = format->height_px,
                    .pixelformat = format->fourcc,
                    .field = V4L2_FIELD_NONE,
                    .bytesperline = format->stride_bytes,
                    .sizeimage = format->image_bytes,
                    .colorspace = V4L2_COLORSPACE_SRGB,
                    .priv = V4L2_PIX_FMT_PRIV_MAGIC},
    };
    return 0;
}

static int set_format(struct opening *by, void *argument)
{
    const struct v4l2_format *const io = argument;
    if (io->type == V4L2_BUF_TYPE_VIDEO_CAPTURE && vqueue_is_busy()) {
        return EBUSY;
    }
    return get_format(by, argument);
}

static int get_parameters(struct opening *by, void *argument)
{
    (void)by;
    struct v4l2_streamparm *const io = argument;
    if (io->type != V4L2_BUF_TYPE_VIDEO_CAPTURE) {
        return EINVAL;
    }
    *io = (struct v4l2_streamparm){
        .type = V4L2_BUF_TYPE_VIDEO_CAPTURE,
        .parm.capture = {.capability = V4L2_CAP_TIMEPERFRAME, .timeperframe = interval},
    };
    return 0;
}

/* ---- buffers ---- */

static int request_buffers(struct opening *by, void *argument)
{
    return vqueue_request(by, argument);
}

static int create_buffers(struct opening *by, void *argument)
{
    return vqueue_create(by, argument);
}

static int query_buffer(struct opening *by, void *argument)
{
    (void)by;
    return vqueue_query(argument);
}

static int prepare_buffer(struct opening *by, void *argument)
{
    return vqueue_prepare(by, argument);
}

static int queue_buffer(struct opening *by, void *argument)
{
    return vqueue_queue(by, argument);
}

static int dequeue_buffer(struct opening *by, void *argument)
{
    return vqueue_dequeue(by, argument);
}

static int export_buffer(struct opening *by, void *argument)
{
    return vqueue_export(by, argument);
}

static int stream_on(struct opening *by, void *argument)
{
    return vqueue_stream_on(by, *(const uint32_t *)argument);
}

static int stream_off(struct opening *by, void *argument)
{
    return vqueue_stream_off(by, *(const uint32_t *)argument);
}

/* guarded: refused while another opening has a higher priority. */
static const struct {
    unsigned int request;
    bool         guarded;
    int (*answer)(struct opening *by, void *argument);
} answers[] = {
    {VIDIOC_QUERYCAP, false, query_capabilities},
    {VIDIOC_G_PRIORITY, false, get_priority},
    {VIDIOC_S_PRIORITY, true, set_priority},
    {VIDIOC_ENUMINPUT, false, enumerate_input},
    {VIDIOC_G_INPUT, false, get_input},
    {VIDIOC_S_INPUT, true, set_input},
    {VIDIOC_ENUM_FMT, false, enumerate_format},
    {VIDIOC_ENUM_FRAMESIZES, false, enumerate_size},
    {VIDIOC_ENUM_FRAMEINTERVALS, false, enumerate_interval},
    {VIDIOC_G_FMT, false, get_format},
    {VIDIOC_TRY_FMT, false, get_format},
    {VIDIOC_S_FMT, true, set_format},
    {VIDIOC_G_PARM, false, get_parameters},
    {VIDIOC_S_PARM, true, get_parameters},
    {VIDIOC_REQBUFS, true, request_buffers},
    {VIDIOC_CREATE_BUFS, true, create_buffers},
    {VIDIOC_QUERYBUF, false, query_buffer},
    {VIDIOC_PREPARE_BUF, false, prepare_buffer},
    {VIDIOC_QBUF, false, queue_buffer},
    {VIDIOC_DQBUF, false, dequeue_buffer},
    {VIDIOC_EXPBUF, false, export_buffer},
    {VIDIOC_STREAMON, true, stream_on},
    {VIDIOC_STREAMOFF, true, stream_off},
};

int answers_ioctl(struct opening *by, unsigned int request, void *argument)
{
    if (vqueue_is_gone()) {
        return ENODEV;
    }
    for (size_t i = 0; i < sizeof answers / sizeof answers[0]; i++) {
        if (answers[i].request == request) {
            _Alignas(16) unsigned char copy[sizeof(struct v4l2_create_buffers)];
            const size_t bytes = _IOC_SIZE(request);
            _Static_assert(sizeof(struct v4l2_format) <= sizeof copy, "the largest fits");
            if (!user_memory_copy(copy, argument, bytes)) {
                return EFAULT;
            }
            if (answers[i].guarded && by->priority < opens_priority()) {
                return EBUSY;
            }
            const int answer = answers[i].answer(by, copy);
            if (answer == 0 && (_IOC_DIR(request) & _IOC_READ) != 0) {
                memcpy(argument, copy, bytes);
            }
            return answer;
        }
    }
    return ENOTTY;
}
