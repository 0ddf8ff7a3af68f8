/* The ioctls on buffers, as videobuf2 answers them: who may, what is allowed when. */
#include "tools/v4l2_shim/vqueue.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "tools/v4l2_shim/delivery.h"
#include "tools/v4l2_shim/user_memory.h"

static struct delivery *const q = &delivery;

static void lock(void)
{
    (void)pthread_mutex_lock(&q->lock);
}

static int unlock(int answer)
{
    (void)pthread_mutex_unlock(&q->lock);
    return answer;
}

bool vqueue_is_busy(void)
{
    lock();
    return unlock(q->count > 0) != 0;
}

bool vqueue_is_streaming(void)
{
    lock();
    return unlock(q->streaming && !delivery_is_gone()) != 0;
}

bool vqueue_is_gone(void)
{
    lock();
    return unlock(delivery_is_gone()) != 0;
}

/* ---- allocation ---- */

static uint64_t whole_pages(uint64_t bytes)
{
    const uint64_t page = (uint64_t)sysconf(_SC_PAGESIZE);
    return (bytes + page - 1) / page * page;
}

static void free_buffer(struct buffer *buffer)
{
    if (buffer->memory_fd >= 0) {
        (void)munmap(buffer->bytes, buffer->length);
        (void)close(buffer->memory_fd);
    }
    *buffer = (struct buffer){.memory_fd = -1};
}

static bool allocate(uint32_t index, size_t length)
{
    struct buffer *const buffer = &q->buffers[index];
    const struct buffer *const before = index == 0 ? NULL : buffer - 1;
    *buffer = (struct buffer){.memory_fd = -1, .length = length};
    buffer->offset = before == NULL ? 0 : before->offset + whole_pages(before->length);
    /* V4L2 has 32 bits for an offset. */
    if (buffer->offset > UINT32_MAX) {
        return false;
    }
    if (q->memory != V4L2_MEMORY_MMAP) {
        return true;
    }
    const int fd = memfd_create("v4l2-buffer", MFD_CLOEXEC);
    if (fd >= 0 && ftruncate(fd, (off_t)buffer->length) == 0) {
        void *const bytes = mmap(NULL, buffer->length, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
        if (bytes != MAP_FAILED) {
            buffer->memory_fd = fd;
            buffer->bytes = bytes;
            return true;
        }
    }
    if (fd >= 0) {
        (void)close(fd);
    }
    return false;
}

/* Adds up to count buffers of length bytes; how many it added. */
static uint32_t allocate_more(uint32_t count, size_t length)
{
    uint32_t added = 0;
    while (added < count && q->count < BUFFERS_MAX && allocate(q->count, length)) {
        q->count++;
        added++;
    }
    return added;
}

static void free_all(void)
{
    delivery_stream_off();
    for (uint32_t i = 0; i < q->count; i++) {
        free_buffer(&q->buffers[i]);
    }
    q->count = 0;
    q->owner = NULL;
}

static const uint32_t buffer_capabilities = V4L2_BUF_CAP_SUPPORTS_MMAP |
                                            V4L2_BUF_CAP_SUPPORTS_USERPTR |
                                            V4L2_BUF_CAP_SUPPORTS_ORPHANED_BUFS;

static bool kind_is_known(uint32_t type, uint32_t memory)
{
    return type == V4L2_BUF_TYPE_VIDEO_CAPTURE &&
           (memory == V4L2_MEMORY_MMAP || memory == V4L2_MEMORY_USERPTR);
}

static bool is_others(const struct opening *by)
{
    return q->owner != NULL && q->owner != by;
}

int vqueue_request(const struct opening *by, struct v4l2_requestbuffers *io)
{
    io->flags = 0;
    memset(io->reserved, 0, sizeof io->reserved);
    if (io->type != V4L2_BUF_TYPE_VIDEO_CAPTURE) {
        return EINVAL;
    }
    io->capabilities = buffer_capabilities;
    if (!kind_is_known(io->type, io->memory)) {
        return EINVAL;
    }
    lock();
    if (is_others(by) || q->streaming) {
        return unlock(EBUSY);
    }
    free_all();
    if (io->count == 0) {
        return unlock(0);
    }
    q->memory = io->memory;
    io->count = allocate_more(io->count, q->folder->format.image_bytes);
    q->owner = io->count > 0 ? by : NULL;
    return unlock(io->count > 0 ? 0 : ENOMEM);
}

int vqueue_create(const struct opening *by, struct v4l2_create_buffers *io)
{
    io->flags = 0;
    memset(io->reserved, 0, sizeof io->reserved);
    io->capabilities = buffer_capabilities;
    lock();
    io->index = q->count;
    if (!kind_is_known(io->format.type, io->memory) ||
        (io->count > 0 && io->format.fmt.pix.sizeimage < q->folder->format.image_bytes)) {
        return unlock(EINVAL);
    }
    if (io->count == 0) {
        return unlock(0);
    }
    if (is_others(by)) {
        return unlock(EBUSY);
    }
    if (q->count > 0 && io->memory != q->memory) {
        return unlock(EINVAL);
    }
    if (q->count == BUFFERS_MAX) {
        return unlock(ENOBUFS);
    }
    q->memory = io->memory;
    io->count = allocate_more(io->count, io->format.fmt.pix.sizeimage);
    if (io->count > 0) {
        q->owner = by;
    }
    return unlock(io->count > 0 ? 0 : ENOMEM);
}

/* ---- one buffer ---- */

static void describe(uint32_t index, struct v4l2_buffer *io)
{
    const struct buffer *const buffer = &q->buffers[index];
    static const uint32_t state_flags[] = {
        [IDLE] = 0,
        [PREPARED] = V4L2_BUF_FLAG_PREPARED,
        [QUEUED] = V4L2_BUF_FLAG_QUEUED,
        [DONE] = V4L2_BUF_FLAG_DONE,
    };
    *io = (struct v4l2_buffer){
        .index = index,
        .type = V4L2_BUF_TYPE_VIDEO_CAPTURE,
        .bytesused = buffer->bytes_used,
        .flags = state_flags[buffer->state] | buffer->flags | V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC |
                 V4L2_BUF_FLAG_TSTAMP_SRC_SOE,
        .field = V4L2_FIELD_NONE,
        .timestamp = buffer->timestamp,
        .sequence = buffer->sequence,
        .memory = q->memory,
        .length = (uint32_t)buffer->length,
    };
    if (q->memory == V4L2_MEMORY_MMAP) {
        io->m.offset = (uint32_t)buffer->offset;
    } else {
        io->m.userptr = (unsigned long)buffer->bytes;
    }
}

int vqueue_query(struct v4l2_buffer *io)
{
    lock();
    if (io->type != V4L2_BUF_TYPE_VIDEO_CAPTURE || io->index >= q->count) {
        return unlock(EINVAL);
    }
    describe(io->index, io);
    return unlock(0);
}

/* Takes the program's memory, where it brings its own. */
static int adopt(struct buffer *buffer, const struct v4l2_buffer *io)
{
    if (q->memory != V4L2_MEMORY_USERPTR) {
        return 0;
    }
    const uint32_t image_bytes = q->folder->format.image_bytes;
    uint8_t *const bytes = (uint8_t *)io->m.userptr;
    const size_t length = io->length == 0 ? image_bytes : io->length;
    if (length < image_bytes) {
        return EINVAL;
    }
    if (!user_memory_is_mapped(bytes, length)) {
        return EFAULT;
    }
    buffer->bytes = bytes;
    buffer->length = length;
    return 0;
}

static int check_one(const struct opening *by, const struct v4l2_buffer *io)
{
    if (is_others(by)) {
        return EBUSY;
    }
    if (io->type != V4L2_BUF_TYPE_VIDEO_CAPTURE || io->index >= q->count ||
        io->memory != q->memory) {
        return EINVAL;
    }
    /* No media requests here. */
    return (io->flags & V4L2_BUF_FLAG_REQUEST_FD) != 0 ? EBADR : 0;
}

int vqueue_prepare(const struct opening *by, struct v4l2_buffer *io)
{
    lock();
    int answer = check_one(by, io);
    if (answer == 0 && q->buffers[io->index].state != IDLE) {
        answer = EINVAL;
    }
    if (answer == 0) {
        answer = adopt(&q->buffers[io->index], io);
    }
    if (answer == 0) {
        q->buffers[io->index].state = PREPARED;
        describe(io->index, io);
    }
    return unlock(answer);
}

int vqueue_queue(const struct opening *by, struct v4l2_buffer *io)
{
    lock();
    int answer = check_one(by, io);
    if (answer != 0) {
        return unlock(answer);
    }
    struct buffer *const buffer = &q->buffers[io->index];
    if (buffer->state == IDLE) {
        answer = adopt(buffer, io);
    } else if (buffer->state != PREPARED) {
        answer = EINVAL;
    }
    if (answer != 0) {
        return unlock(answer);
    }
    buffer->state = QUEUED;
    buffer->flags = 0;
    buffer->timestamp = (struct timeval){0};
    delivery_push(&q->queued, io->index);
    describe(io->index, io);
    delivery_fill_lockstep();
    return unlock(0);
}

/* Waits, unlocked, until there may be something to dequeue. */
static int wait_for_frame(const struct opening *by)
{
    struct pollfd ready[] = {{.fd = by->event_fd, .events = POLLIN},
                             {.fd = q->stopped_fd, .events = POLLIN}};
    (void)unlock(0);
    const int answer = poll(ready, 2, -1) < 0 ? errno : 0;
    lock();
    return answer;
}

int vqueue_dequeue(const struct opening *by, struct v4l2_buffer *io)
{
    lock();
    if (is_others(by)) {
        return unlock(EBUSY);
    }
    if (io->type != V4L2_BUF_TYPE_VIDEO_CAPTURE) {
        return unlock(EINVAL);
    }
    while (q->streaming && q->done.count == 0) {
        if (q->unplugged) {
            return unlock(ENODEV);
        }
        if (q->ended) {
            return unlock(EPIPE);
        }
        if ((fcntl(by->event_fd, F_GETFL) & O_NONBLOCK) != 0) {
            return unlock(EAGAIN);
        }
        const int answer = wait_for_frame(by);
        if (answer != 0) {
            return unlock(answer);
        }
    }
    if (!q->streaming || io->memory != q->memory) {
        return unlock(EINVAL);
    }
    const uint32_t index = delivery_pop(&q->done);
    opens_take(by);
    q->buffers[index].state = IDLE;
    describe(index, io);
    return unlock(0);
}

int vqueue_export(const struct opening *by, struct v4l2_exportbuffer *io)
{
    memset(io->reserved, 0, sizeof io->reserved);
    lock();
    if (is_others(by)) {
        return unlock(EBUSY);
    }
    if (io->type != V4L2_BUF_TYPE_VIDEO_CAPTURE || io->index >= q->count || io->plane != 0 ||
        q->memory != V4L2_MEMORY_MMAP ||
        (io->flags & ~(uint32_t)(O_CLOEXEC | O_ACCMODE)) != 0) {
        return unlock(EINVAL);
    }
    const int how = (io->flags & O_CLOEXEC) != 0 ? F_DUPFD_CLOEXEC : F_DUPFD;
    const int fd = fcntl(q->buffers[io->index].memory_fd, how, 0);
    if (fd < 0) {
        return unlock(errno);
    }
    io->fd = fd;
    return unlock(0);
}

int vqueue_memory_at(uint64_t offset, size_t length)
{
    int fd = -1;
    lock();
    for (uint32_t i = 0; i < q->count && q->memory == V4L2_MEMORY_MMAP; i++) {
        if (q->buffers[i].offset == offset && length <= whole_pages(q->buffers[i].length)) {
            fd = q->buffers[i].memory_fd;
        }
    }
    (void)unlock(0);
    return fd;
}

/* ---- the stream ---- */

int vqueue_stream_on(const struct opening *by, uint32_t type)
{
    lock();
    if (is_others(by)) {
        return unlock(EBUSY);
    }
    if (type != V4L2_BUF_TYPE_VIDEO_CAPTURE || q->count == 0) {
        return unlock(EINVAL);
    }
    if (q->streaming) {
        return unlock(0);
    }
    return unlock(delivery_stream_on() ? 0 : ENOMEM);
}

int vqueue_stream_off(const struct opening *by, uint32_t type)
{
    lock();
    if (is_others(by)) {
        return unlock(EBUSY);
    }
    if (type != V4L2_BUF_TYPE_VIDEO_CAPTURE) {
        return unlock(EINVAL);
    }
    delivery_stream_off();
    return unlock(0);
}

void vqueue_leave(const struct opening *by)
{
    lock();
    if (q->owner == by) {
        free_all();
    }
    (void)unlock(0);
}
