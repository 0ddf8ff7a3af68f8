/* Buffers as videobuf2 keeps them: requested, queued, filled, dequeued.
 *
 * Lockstep needs no thread: a buffer is filled the moment it is queued on a running stream, so the
 * same program always gets the same frames in the same buffers. Paced frames come from one thread
 * that is started at the first STREAMON and stays. */
#include "tools/v4l2_shim/vqueue.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include "tools/v4l2_shim/user_memory.h"

enum { BUFFERS_MAX = VIDEO_MAX_FRAME };

enum state { IDLE, PREPARED, QUEUED, DONE };

struct buffer {
    enum state     state;
    int            memory_fd; /* MMAP: the memory; -1 otherwise */
    uint8_t       *bytes;     /* MMAP: our mapping of it; USERPTR: the program's memory */
    size_t         length;
    uint64_t       offset; /* MMAP: what the program passes to mmap */
    uint32_t       bytes_used;
    uint32_t       flags; /* V4L2_BUF_FLAG_ERROR or nothing */
    uint32_t       sequence;
    struct timeval timestamp;
};

/* First in, first out, of buffer indices. */
struct line {
    uint32_t at[BUFFERS_MAX];
    uint32_t count;
};

static struct {
    pthread_mutex_t       lock;
    pthread_cond_t        changed; /* streaming began: the pacing thread has work */
    const struct folder  *folder;
    int64_t               period_ns; /* 0: lockstep */
    bool                  once;
    const struct opening *owner; /* whose buffers they are; NULL: nobody's */
    uint32_t              memory;
    struct buffer         buffers[BUFFERS_MAX];
    uint32_t              count;
    struct line           queued;
    struct line           done;
    bool                  streaming;
    bool                  ended;      /* once: all frames are out */
    bool                  has_thread; /* the pacing one */
    uint64_t              due;        /* frames that came due since STREAMON, dropped ones too */
    int64_t               started_ns;
    int                   stopped_fd; /* readable while not streaming: wakes a waiting DQBUF */
} q = {.lock = PTHREAD_MUTEX_INITIALIZER};

static void lock(void)
{
    (void)pthread_mutex_lock(&q.lock);
}

static int unlock(int answer)
{
    (void)pthread_mutex_unlock(&q.lock);
    return answer;
}

static void line_push(struct line *line, uint32_t index)
{
    line->at[line->count++] = index;
}

static uint32_t line_pop(struct line *line)
{
    const uint32_t index = line->at[0];
    line->count--;
    memmove(line->at, line->at + 1, line->count * sizeof line->at[0]);
    return index;
}

static int64_t now_ns(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

void vqueue_start(const struct folder *folder, int64_t period_ns, bool once)
{
    pthread_condattr_t monotonic;
    (void)pthread_condattr_init(&monotonic);
    (void)pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    (void)pthread_cond_init(&q.changed, &monotonic);
    (void)pthread_condattr_destroy(&monotonic);
    q.folder = folder;
    q.period_ns = period_ns;
    q.once = once;
    q.stopped_fd = eventfd(1, EFD_NONBLOCK | EFD_CLOEXEC);
}

bool vqueue_is_busy(void)
{
    lock();
    return unlock(q.count > 0) != 0;
}

bool vqueue_is_streaming(void)
{
    lock();
    return unlock(q.streaming) != 0;
}

/* ---- frames into buffers ---- */

/* What V4L2 calls the start of exposure. Rounded down, as its unit is the microsecond. */
static struct timeval stamp(const struct folder_frame *frame, uint64_t pass)
{
    int64_t t_ns = q.folder->timed ? frame->t_ns - frame->exposure_ns / 2 +
                                         (int64_t)pass * q.folder->loop_ns
                                   : now_ns();
    int64_t seconds = t_ns / 1000000000;
    int64_t rest_ns = t_ns % 1000000000;
    if (rest_ns < 0) {
        seconds--;
        rest_ns += 1000000000;
    }
    return (struct timeval){.tv_sec = seconds, .tv_usec = rest_ns / 1000};
}

static void fill(struct buffer *buffer)
{
    const size_t index = q.due % q.folder->count;
    char sentence[SENTENCE_BYTES];
    const bool fine = folder_read(q.folder, index, buffer->bytes, sentence);
    if (!fine) {
        (void)fprintf(stderr, "tessera-replay: %s; the program gets a frame marked as broken\n",
                      sentence);
    }
    buffer->bytes_used = fine ? q.folder->format.image_bytes : 0;
    buffer->flags = fine ? 0 : V4L2_BUF_FLAG_ERROR;
    buffer->sequence = (uint32_t)q.due;
    buffer->timestamp = stamp(&q.folder->frames[index], q.due / q.folder->count);
    buffer->state = DONE;
}

/* One frame comes due: into the first queued buffer, or past us. */
static void frame_due(void)
{
    if (q.queued.count > 0) {
        const uint32_t index = line_pop(&q.queued);
        fill(&q.buffers[index]);
        line_push(&q.done, index);
        opens_post(q.owner);
    }
    q.due++;
    if (q.once && q.due == q.folder->count) {
        q.ended = true;
        opens_post(q.owner);
    }
}

static void fill_lockstep(void)
{
    while (q.period_ns == 0 && q.streaming && !q.ended && q.queued.count > 0) {
        frame_due();
    }
}

static void *pace(void *unused)
{
    (void)unused;
    lock();
    for (;;) {
        if (!q.streaming || q.ended) {
            (void)pthread_cond_wait(&q.changed, &q.lock);
            continue;
        }
        const int64_t next_ns = q.started_ns + (int64_t)(q.due + 1) * q.period_ns;
        if (now_ns() >= next_ns) {
            frame_due();
        } else {
            const struct timespec until = {.tv_sec = next_ns / 1000000000,
                                           .tv_nsec = next_ns % 1000000000};
            (void)pthread_cond_timedwait(&q.changed, &q.lock, &until);
        }
    }
    return NULL;
}

static bool have_thread(void)
{
    if (q.period_ns == 0 || q.has_thread) {
        return true;
    }
    /* The program's signals are for the program's threads. */
    sigset_t all;
    sigset_t before;
    (void)sigfillset(&all);
    (void)pthread_sigmask(SIG_SETMASK, &all, &before);
    pthread_t thread;
    q.has_thread = pthread_create(&thread, NULL, pace, NULL) == 0;
    if (q.has_thread) {
        (void)pthread_detach(thread);
    }
    (void)pthread_sigmask(SIG_SETMASK, &before, NULL);
    return q.has_thread;
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
    struct buffer *const buffer = &q.buffers[index];
    const struct buffer *const before = index == 0 ? NULL : buffer - 1;
    *buffer = (struct buffer){.memory_fd = -1, .length = length};
    buffer->offset = before == NULL ? 0 : before->offset + whole_pages(before->length);
    /* V4L2 has 32 bits for an offset. */
    if (buffer->offset > UINT32_MAX) {
        return false;
    }
    if (q.memory != V4L2_MEMORY_MMAP) {
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
    while (added < count && q.count < BUFFERS_MAX && allocate(q.count, length)) {
        q.count++;
        added++;
    }
    return added;
}

static void stop(void)
{
    if (q.streaming) {
        const uint64_t one = 1;
        const ssize_t written = write(q.stopped_fd, &one, sizeof one);
        (void)written; /* its count was 0, see vqueue_stream_on */
        opens_drain(q.owner);
    }
    q.streaming = false;
    q.queued.count = 0;
    q.done.count = 0;
    for (uint32_t i = 0; i < q.count; i++) {
        q.buffers[i].state = IDLE;
    }
}

static void free_all(void)
{
    stop();
    for (uint32_t i = 0; i < q.count; i++) {
        free_buffer(&q.buffers[i]);
    }
    q.count = 0;
    q.owner = NULL;
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
    return q.owner != NULL && q.owner != by;
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
    if (is_others(by) || q.streaming) {
        return unlock(EBUSY);
    }
    free_all();
    if (io->count == 0) {
        return unlock(0);
    }
    q.memory = io->memory;
    io->count = allocate_more(io->count, q.folder->format.image_bytes);
    q.owner = io->count > 0 ? by : NULL;
    return unlock(io->count > 0 ? 0 : ENOMEM);
}

int vqueue_create(const struct opening *by, struct v4l2_create_buffers *io)
{
    io->flags = 0;
    memset(io->reserved, 0, sizeof io->reserved);
    io->capabilities = buffer_capabilities;
    lock();
    io->index = q.count;
    if (!kind_is_known(io->format.type, io->memory) ||
        (io->count > 0 && io->format.fmt.pix.sizeimage < q.folder->format.image_bytes)) {
        return unlock(EINVAL);
    }
    if (io->count == 0) {
        return unlock(0);
    }
    if (is_others(by)) {
        return unlock(EBUSY);
    }
    if (q.count > 0 && io->memory != q.memory) {
        return unlock(EINVAL);
    }
    if (q.count == BUFFERS_MAX) {
        return unlock(ENOBUFS);
    }
    q.memory = io->memory;
    io->count = allocate_more(io->count, io->format.fmt.pix.sizeimage);
    if (io->count > 0) {
        q.owner = by;
    }
    return unlock(io->count > 0 ? 0 : ENOMEM);
}

/* ---- one buffer ---- */

static void describe(uint32_t index, struct v4l2_buffer *io)
{
    const struct buffer *const buffer = &q.buffers[index];
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
        .memory = q.memory,
        .length = (uint32_t)buffer->length,
    };
    if (q.memory == V4L2_MEMORY_MMAP) {
        io->m.offset = (uint32_t)buffer->offset;
    } else {
        io->m.userptr = (unsigned long)buffer->bytes;
    }
}

int vqueue_query(struct v4l2_buffer *io)
{
    lock();
    if (io->type != V4L2_BUF_TYPE_VIDEO_CAPTURE || io->index >= q.count) {
        return unlock(EINVAL);
    }
    describe(io->index, io);
    return unlock(0);
}

/* Takes the program's memory, where it brings its own. */
static int adopt(struct buffer *buffer, const struct v4l2_buffer *io)
{
    if (q.memory != V4L2_MEMORY_USERPTR) {
        return 0;
    }
    const uint32_t image_bytes = q.folder->format.image_bytes;
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
    if (io->type != V4L2_BUF_TYPE_VIDEO_CAPTURE || io->index >= q.count || io->memory != q.memory) {
        return EINVAL;
    }
    /* No media requests here. */
    return (io->flags & V4L2_BUF_FLAG_REQUEST_FD) != 0 ? EBADR : 0;
}

int vqueue_prepare(const struct opening *by, struct v4l2_buffer *io)
{
    lock();
    int answer = check_one(by, io);
    if (answer == 0 && q.buffers[io->index].state != IDLE) {
        answer = EINVAL;
    }
    if (answer == 0) {
        answer = adopt(&q.buffers[io->index], io);
    }
    if (answer == 0) {
        q.buffers[io->index].state = PREPARED;
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
    struct buffer *const buffer = &q.buffers[io->index];
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
    line_push(&q.queued, io->index);
    describe(io->index, io);
    fill_lockstep();
    return unlock(0);
}

/* Waits, unlocked, until there may be something to dequeue. */
static int wait_for_frame(const struct opening *by)
{
    struct pollfd ready[] = {{.fd = by->event_fd, .events = POLLIN},
                             {.fd = q.stopped_fd, .events = POLLIN}};
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
    while (q.streaming && q.done.count == 0) {
        if (q.ended) {
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
    if (!q.streaming || io->memory != q.memory) {
        return unlock(EINVAL);
    }
    const uint32_t index = line_pop(&q.done);
    opens_take(by);
    q.buffers[index].state = IDLE;
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
    if (io->type != V4L2_BUF_TYPE_VIDEO_CAPTURE || io->index >= q.count || io->plane != 0 ||
        q.memory != V4L2_MEMORY_MMAP ||
        (io->flags & ~(uint32_t)(O_CLOEXEC | O_ACCMODE)) != 0) {
        return unlock(EINVAL);
    }
    const int how = (io->flags & O_CLOEXEC) != 0 ? F_DUPFD_CLOEXEC : F_DUPFD;
    const int fd = fcntl(q.buffers[io->index].memory_fd, how, 0);
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
    for (uint32_t i = 0; i < q.count && q.memory == V4L2_MEMORY_MMAP; i++) {
        if (q.buffers[i].offset == offset && length <= whole_pages(q.buffers[i].length)) {
            fd = q.buffers[i].memory_fd;
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
    if (type != V4L2_BUF_TYPE_VIDEO_CAPTURE || q.count == 0) {
        return unlock(EINVAL);
    }
    if (q.streaming) {
        return unlock(0);
    }
    if (!have_thread()) {
        return unlock(ENOMEM);
    }
    uint64_t count;
    const ssize_t taken = read(q.stopped_fd, &count, sizeof count);
    (void)taken; /* it does not block; afterwards the count is 0 either way */
    q.streaming = true;
    q.ended = false;
    q.due = 0;
    q.started_ns = now_ns();
    fill_lockstep();
    (void)pthread_cond_broadcast(&q.changed);
    return unlock(0);
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
    stop();
    return unlock(0);
}

void vqueue_leave(const struct opening *by)
{
    lock();
    if (q.owner == by) {
        free_all();
    }
    (void)unlock(0);
}
