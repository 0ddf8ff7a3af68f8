/* The V4L2 backend. What the driver says is checked before it is used: formats, sizes, indices. */
#include "firmware/capture/v4l2.h"

#include <assert.h>
#include <errno.h>
#include <linux/videodev2.h>
#include <stdio.h>
#include <string.h>

enum {
    BUFFERS_DEFAULT = 4,
    BUFFERS_MIN = 2, /* one with us, one with the driver */
    FAULTS_MAX = 100, /* that often in a row EIO is no passing trouble */
};

/* What we can read, and its name for people. */
static const struct kind {
    const char       *name;
    uint32_t          fourcc;
    enum frame_format format;
} kinds[] = {
    { "GREY", V4L2_PIX_FMT_GREY, FRAME_GREY8 }, { "Y10", V4L2_PIX_FMT_Y10, FRAME_GREY10 },
    { "Y12", V4L2_PIX_FMT_Y12, FRAME_GREY12 },  { "Y16", V4L2_PIX_FMT_Y16, FRAME_GREY16 },
    { "YUYV", V4L2_PIX_FMT_YUYV, FRAME_YUYV },  { "UYVY", V4L2_PIX_FMT_UYVY, FRAME_UYVY },
    { "NV12", V4L2_PIX_FMT_NV12, FRAME_NV12 },
};
enum { KINDS = sizeof kinds / sizeof kinds[0] };

static struct v4l2_camera *camera_of(struct capture *capture)
{
    return (struct v4l2_camera *)capture;
}

static int ask(struct v4l2_camera *camera, unsigned long request, void *argument)
{
    return camera->sys->ioctl(camera->fd, request, argument);
}

/* A request failed that every camera must be able to answer. */
static bool refuse(struct v4l2_camera *camera, const char *what, int answer)
{
    if (answer == -EBUSY) {
        return capture_say(&camera->base, "%s: the camera is in use by another program",
                           camera->device);
    } else if (answer == -ENODEV) {
        return capture_say(&camera->base, "%s: the camera was unplugged", camera->device);
    } else {
        return capture_say(&camera->base, "%s: the camera cannot %s: %s", camera->device, what,
                           camera->sys->error_text(-answer));
    }
}

/* ---- which device ---- */

static bool open_device(struct v4l2_camera *camera)
{
    camera->fd = camera->sys->open(camera->device);
    switch (camera->fd) {
    case -ENOENT:
    case -ENODEV:
    case -ENXIO:
        return capture_say(&camera->base, "%s: there is no such device; is the camera plugged in?",
                           camera->device);
    case -EACCES:
    case -EPERM:
        return capture_say(&camera->base,
                           "%s: may not be opened; is the user in the group that owns it?",
                           camera->device);
    default:
        return camera->fd >= 0 || refuse(camera, "be opened", camera->fd);
    }
}

/* One field of the driver's, as printable text of at most CAPTURE_SERIAL_BYTES - 1 bytes. */
static void copy_text(char to[CAPTURE_SERIAL_BYTES], const char *from, size_t bytes)
{
    size_t length = 0;
    while (length < bytes && length < CAPTURE_SERIAL_BYTES - 1 && from[length] != '\0') {
        const char c = from[length];
        to[length] = '_';
        if (c > ' ' && c <= '~') {
            to[length] = c;
        }
        length++;
    }
    to[length] = '\0';
}

/* The user's name for the camera; else the bus, because it tells two cameras of one make apart;
 * else the make. */
static void choose_serial(struct v4l2_camera *camera, const struct capture_options *options,
                          const struct v4l2_capability *device)
{
    char *const serial = camera->base.info.serial;
    if (options->serial != NULL && options->serial[0] != '\0') {
        copy_text(serial, options->serial, strlen(options->serial));
    } else {
        copy_text(serial, (const char *)device->bus_info, sizeof device->bus_info);
        if (serial[0] == '\0') {
            copy_text(serial, (const char *)device->card, sizeof device->card);
        }
        if (serial[0] == '\0') {
            copy_text(serial, camera->device, strlen(camera->device));
        }
    }
}

static bool identify(struct v4l2_camera *camera, const struct capture_options *options)
{
    struct v4l2_capability device = { 0 };
    const int answer = ask(camera, VIDIOC_QUERYCAP, &device);
    if (answer == -ENOTTY || answer == -EINVAL) {
        return capture_say(&camera->base, "%s: is not a V4L2 device", camera->device);
    }
    if (answer < 0) {
        return refuse(camera, "say what it is", answer);
    }
    const uint32_t can = (device.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? device.device_caps
                                                                           : device.capabilities;
    if ((can & V4L2_CAP_VIDEO_CAPTURE) == 0) {
        return capture_say(&camera->base, "%s: is a V4L2 device but does not capture video%s",
                           camera->device,
                           (can & V4L2_CAP_VIDEO_CAPTURE_MPLANE) != 0
                               ? " in one plane, and several planes are not supported"
                               : "; cameras often have a second node for metadata, try the other");
    }
    if ((can & V4L2_CAP_STREAMING) == 0) {
        return capture_say(&camera->base, "%s: the camera cannot stream into mapped buffers",
                           camera->device);
    }
    choose_serial(camera, options, &device);
    return true;
}

/* ---- which format ---- */

static const struct kind *kind_of(uint32_t fourcc)
{
    for (size_t i = 0; i < KINDS; i++) {
        if (kinds[i].fourcc == fourcc) {
            return &kinds[i];
        }
    }
    return NULL;
}

/* Appends a word to a list of words, as long as there is room. */
static void append(char *list, size_t bytes, const char *word)
{
    const size_t used = strlen(list);
    (void)snprintf(list + used, bytes - used, "%s%s", used > 0 ? " " : "", word);
}

/* The fourcc as text; a byte that is no letter shows as '?'. */
static void spell(uint32_t fourcc, char to[5])
{
    for (int i = 0; i < 4; i++) {
        const char c = (char)(fourcc >> (8 * i) & 0x7f);
        to[i] = c;
        if (c < ' ' || c > '~') {
            to[i] = '?';
        }
    }
    to[4] = '\0';
    for (int i = 3; i > 0 && to[i] == ' '; i--) {
        to[i] = '\0';
    }
}

/* The kind to use: the wanted one, or the present one, or the first that we can read. */
static const struct kind *choose_kind(struct v4l2_camera *camera, const char *wanted,
                                      uint32_t present)
{
    const struct kind *chosen = NULL;
    char offered[256] = "";
    /* A driver that never ends its list is broken; no camera has hundreds of formats. */
    for (uint32_t i = 0; i < 256; i++) {
        struct v4l2_fmtdesc entry = { .index = i, .type = V4L2_BUF_TYPE_VIDEO_CAPTURE };
        if (ask(camera, VIDIOC_ENUM_FMT, &entry) < 0) {
            break;
        }
        char name[5];
        spell(entry.pixelformat, name);
        append(offered, sizeof offered, name);
        const struct kind *const kind = kind_of(entry.pixelformat);
        if (kind == NULL || (wanted != NULL && strcmp(kind->name, wanted) != 0)) {
            continue;
        }
        if (chosen == NULL || kind->fourcc == present) {
            chosen = kind;
        }
    }
    if (chosen == NULL) {
        const char *const list = offered[0] == '\0' ? "nothing" : offered;
        if (wanted != NULL) {
            (void)capture_say(&camera->base, "%s: the camera does not offer %s; it offers: %s",
                              camera->device, wanted, list);
        } else {
            (void)capture_say(&camera->base,
                              "%s: the camera offers none of GREY Y10 Y12 Y16 YUYV UYVY NV12, but: "
                              "%s",
                              camera->device, list);
        }
    }
    return chosen;
}

static bool refuse_size(struct v4l2_camera *camera, const struct capture_options *options,
                        const struct v4l2_pix_format *got)
{
    char offered[256] = "";
    for (uint32_t i = 0; i < 64; i++) {
        struct v4l2_frmsizeenum entry = { .index = i, .pixel_format = got->pixelformat };
        if (ask(camera, VIDIOC_ENUM_FRAMESIZES, &entry) < 0 ||
            entry.type != V4L2_FRMSIZE_TYPE_DISCRETE) {
            break;
        }
        char size[32];
        (void)snprintf(size, sizeof size, "%ux%u", entry.discrete.width, entry.discrete.height);
        append(offered, sizeof offered, size);
    }
    return capture_say(&camera->base, "%s: the camera does not offer %ux%u; nearest is %ux%u%s%s",
                       camera->device, options->width_px, options->height_px, got->width,
                       got->height, offered[0] == '\0' ? "" : ", all are: ", offered);
}

/* Believes the driver's answer only where it makes sense. */
static bool accept_format(struct v4l2_camera *camera, const struct kind *kind,
                          const struct v4l2_pix_format *got)
{
    struct capture_info *const info = &camera->base.info;
    if (got->pixelformat != kind->fourcc) {
        return capture_say(&camera->base, "%s: the camera lists %s but does not deliver it",
                           camera->device, kind->name);
    }
    if (got->field != V4L2_FIELD_NONE && got->field != V4L2_FIELD_ANY) {
        return capture_say(&camera->base, "%s: the camera delivers interlaced fields, not frames",
                           camera->device);
    }
    if (got->width < 1 || got->width > UINT16_MAX || got->height < 1 || got->height > UINT16_MAX) {
        return capture_say(&camera->base, "%s: the camera's size %ux%u is out of range",
                           camera->device, got->width, got->height);
    }
    info->format = kind->format;
    info->width_px = (uint16_t)got->width;
    info->height_px = (uint16_t)got->height;
    const uint32_t row_bytes = frame_row_bytes(info->format, info->width_px);
    info->stride_bytes = got->bytesperline == 0 ? row_bytes : got->bytesperline;
    const uint64_t rows = info->format == FRAME_NV12 ? info->height_px + info->height_px / 2u
                                                     : info->height_px;
    /* The last row's padding may be missing. */
    const uint64_t frame_bytes = (rows - 1) * info->stride_bytes + row_bytes;
    if (info->stride_bytes < row_bytes || frame_bytes > INT32_MAX) {
        return capture_say(&camera->base, "%s: the camera's row length of %u bytes makes no sense",
                           camera->device, info->stride_bytes);
    }
    camera->frame_bytes = (uint32_t)frame_bytes;
    return true;
}

static bool settle_format(struct v4l2_camera *camera, const struct capture_options *options)
{
    struct v4l2_format format = { .type = V4L2_BUF_TYPE_VIDEO_CAPTURE };
    int answer = ask(camera, VIDIOC_G_FMT, &format);
    if (answer < 0) {
        return refuse(camera, "say its format", answer);
    }
    const struct kind *const kind =
        choose_kind(camera, options->format, format.fmt.pix.pixelformat);
    if (kind == NULL) {
        return false;
    }
    struct v4l2_pix_format *const pix = &format.fmt.pix;
    pix->pixelformat = kind->fourcc;
    pix->field = V4L2_FIELD_NONE;
    pix->bytesperline = 0;
    pix->sizeimage = 0;
    if (options->width_px != 0) {
        pix->width = options->width_px;
        pix->height = options->height_px;
    }
    answer = ask(camera, VIDIOC_S_FMT, &format);
    if (answer < 0) {
        return refuse(camera, "take a format", answer);
    }
    if (options->width_px != 0 &&
        (pix->width != options->width_px || pix->height != options->height_px)) {
        return refuse_size(camera, options, pix);
    }
    return accept_format(camera, kind, pix);
}

/* ---- buffers ---- */

static bool map_buffer(struct v4l2_camera *camera, uint32_t index)
{
    struct v4l2_buffer buffer = {
        .index = index, .type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .memory = V4L2_MEMORY_MMAP
    };
    int answer = ask(camera, VIDIOC_QUERYBUF, &buffer);
    if (answer < 0) {
        return refuse(camera, "describe its buffers", answer);
    }
    if (buffer.length < camera->frame_bytes) {
        return capture_say(&camera->base,
                           "%s: the camera's buffers of %u bytes hold no frame of %u bytes",
                           camera->device, buffer.length, camera->frame_bytes);
    }
    answer = camera->sys->map(camera->fd, buffer.m.offset, buffer.length,
                              &camera->buffers[index].memory);
    if (answer < 0) {
        return refuse(camera, "map its buffers", answer);
    }
    camera->buffers[index].bytes = buffer.length;
    camera->buffer_count = index + 1;
    camera->base.info.clock =
        (buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC
            ? CAPTURE_CLOCK_MONOTONIC
            : CAPTURE_CLOCK_UNKNOWN;
    return true;
}

static bool get_buffers(struct v4l2_camera *camera, const struct capture_options *options)
{
    struct v4l2_requestbuffers request = {
        .count = options->buffers == 0 ? BUFFERS_DEFAULT : options->buffers,
        .type = V4L2_BUF_TYPE_VIDEO_CAPTURE,
        .memory = V4L2_MEMORY_MMAP,
    };
    if (request.count < BUFFERS_MIN || request.count > V4L2_BUFFERS_MAX) {
        return capture_say(&camera->base, "%s: the number of buffers must be 2..32, not %u",
                           camera->device, request.count);
    }
    const int answer = ask(camera, VIDIOC_REQBUFS, &request);
    if (answer < 0) {
        return refuse(camera, "give buffers", answer);
    }
    if (request.count < BUFFERS_MIN) {
        return capture_say(&camera->base, "%s: the camera has no memory for two buffers",
                           camera->device);
    }
    /* It may give more than was asked for, but not more than we can keep. */
    const uint32_t count = request.count < V4L2_BUFFERS_MAX ? request.count : V4L2_BUFFERS_MAX;
    for (uint32_t i = 0; i < count; i++) {
        if (!map_buffer(camera, i)) {
            return false;
        }
    }
    return true;
}

static void close_camera(struct capture *capture)
{
    struct v4l2_camera *const camera = camera_of(capture);
    if (camera->fd < 0) {
        return;
    }
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    (void)ask(camera, VIDIOC_STREAMOFF, &type); /* closing ends the stream in any case */
    for (uint32_t i = 0; i < camera->buffer_count; i++) {
        camera->sys->unmap(camera->buffers[i].memory, camera->buffers[i].bytes);
    }
    camera->buffer_count = 0;
    camera->sys->close(camera->fd);
    camera->fd = -1;
}

static bool open_camera(struct capture *capture, const struct capture_options *options)
{
    struct v4l2_camera *const camera = camera_of(capture);
    camera->device = options->device;
    camera->buffer_count = 0;
    camera->faults = 0;
    camera->queue_error = 0;
    if (!open_device(camera)) {
        camera->fd = -1;
        return false;
    }
    if (!identify(camera, options) || !settle_format(camera, options) ||
        !get_buffers(camera, options)) {
        close_camera(capture);
        return false;
    }
    return true;
}

/* ---- frames ---- */

static int queue(struct v4l2_camera *camera, uint32_t index)
{
    struct v4l2_buffer buffer = {
        .index = index, .type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .memory = V4L2_MEMORY_MMAP
    };
    return ask(camera, VIDIOC_QBUF, &buffer);
}

static bool start(struct capture *capture)
{
    struct v4l2_camera *const camera = camera_of(capture);
    for (uint32_t i = 0; i < camera->buffer_count; i++) {
        const int answer = queue(camera, i);
        if (answer < 0) {
            return refuse(camera, "take its buffers", answer);
        }
    }
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    const int answer = ask(camera, VIDIOC_STREAMON, &type);
    return answer >= 0 || refuse(camera, "start streaming", answer);
}

static enum capture_status stopped(struct v4l2_camera *camera, int error)
{
    switch (error) {
    case EPIPE:
        (void)capture_say(&camera->base, "%s: the stream has ended", camera->device);
        return CAPTURE_ENDED;
    case ENODEV:
        (void)capture_say(&camera->base, "%s: the camera was unplugged", camera->device);
        return CAPTURE_UNPLUGGED;
    default:
        (void)capture_say(&camera->base, "%s: the camera stopped delivering frames: %s",
                          camera->device, camera->sys->error_text(error));
        return CAPTURE_FAILED;
    }
}

/* EIO and a device in error may pass (a cable, a lost signal), but not for ever. */
static enum capture_status passing_fault(struct v4l2_camera *camera)
{
    camera->faults++;
    return camera->faults < FAULTS_MAX ? CAPTURE_NONE : stopped(camera, EIO);
}

static enum capture_status next(struct capture *capture, uint32_t timeout_ms,
                                struct capture_arrival *out)
{
    struct v4l2_camera *const camera = camera_of(capture);
    if (camera->queue_error != 0) {
        return stopped(camera, camera->queue_error);
    }
    const int ready = camera->sys->wait(camera->fd, timeout_ms);
    if (ready == 0) {
        return CAPTURE_NONE;
    }
    if (ready < 0 && ready != -EIO) {
        return stopped(camera, -ready);
    }
    struct v4l2_buffer buffer = { .type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .memory = V4L2_MEMORY_MMAP };
    const int answer = ask(camera, VIDIOC_DQBUF, &buffer);
    if (answer == -EAGAIN) {
        return ready < 0 ? passing_fault(camera) : CAPTURE_NONE;
    }
    if (answer == -EIO) {
        return passing_fault(camera);
    }
    if (answer < 0) {
        return stopped(camera, -answer);
    }
    if (buffer.index >= camera->buffer_count) {
        return stopped(camera, EPROTO);
    }
    camera->faults = 0;
    camera->held = buffer.index;
    *out = (struct capture_arrival){
        .pixels = camera->buffers[buffer.index].memory,
        .sequence = buffer.sequence,
        .stamp_ns = (int64_t)buffer.timestamp.tv_sec * 1000000000 +
                    (int64_t)buffer.timestamp.tv_usec * 1000,
        .stamp_is_start =
            (buffer.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE,
        .broken = (buffer.flags & V4L2_BUF_FLAG_ERROR) != 0 ||
                  buffer.bytesused < camera->frame_bytes,
    };
    return CAPTURE_FRAME;
}

static void release(struct capture *capture)
{
    struct v4l2_camera *const camera = camera_of(capture);
    const int answer = queue(camera, camera->held);
    /* The next call for a frame says so. */
    camera->queue_error = answer < 0 ? -answer : 0;
}

struct capture *v4l2_capture(struct v4l2_camera *camera, const struct v4l2_sys *sys)
{
    static const struct capture_backend backend = {
        .open = open_camera,
        .start = start,
        .next = next,
        .release = release,
        .close = close_camera,
    };
    static_assert(offsetof(struct v4l2_camera, base) == 0, "a capture is the camera's address");
    *camera = (struct v4l2_camera){ .base = { .backend = &backend }, .sys = sys, .fd = -1 };
    return &camera->base;
}
