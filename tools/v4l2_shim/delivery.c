/* Frames into buffers, in lockstep or paced.
 *
 * Lockstep needs no thread: a buffer is filled the moment it is queued on a running stream, so the
 * same program always gets the same frames in the same buffers. Paced frames come from one thread
 * that is started at the first STREAMON and stays. */
#include "tools/v4l2_shim/delivery.h"

#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

struct delivery delivery = {.lock = PTHREAD_MUTEX_INITIALIZER};
static struct delivery *const q = &delivery;

void delivery_push(struct line *line, uint32_t index)
{
    line->at[line->count++] = index;
}

uint32_t delivery_pop(struct line *line)
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

void delivery_start(const struct folder *folder, const struct faults *faults, int64_t period_ns,
                    bool once)
{
    pthread_condattr_t monotonic;
    (void)pthread_condattr_init(&monotonic);
    (void)pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    (void)pthread_cond_init(&q->changed, &monotonic);
    (void)pthread_condattr_destroy(&monotonic);
    q->folder = folder;
    q->faults = faults;
    q->period_ns = period_ns;
    q->once = once;
    q->stopped_fd = eventfd(1, EFD_NONBLOCK | EFD_CLOEXEC);
}

bool delivery_is_gone(void)
{
    return q->unplugged && q->done.count == 0;
}

/* What V4L2 calls the start of exposure. Rounded down, as its unit is the microsecond. */
static struct timeval stamp(const struct folder_frame *frame, uint64_t pass)
{
    const int64_t start_ns = frame->t_ns - frame->exposure_ns / 2;
    const int64_t t_ns =
        q->folder->timed ? start_ns + (int64_t)pass * q->folder->loop_ns : now_ns();
    int64_t seconds = t_ns / 1000000000;
    int64_t rest_ns = t_ns % 1000000000;
    if (rest_ns < 0) {
        seconds--;
        rest_ns += 1000000000;
    }
    return (struct timeval){.tv_sec = seconds, .tv_usec = rest_ns / 1000};
}

static void fill(struct buffer *buffer, enum fault fault)
{
    const size_t index = q->due % q->folder->count;
    char sentence[SENTENCE_BYTES];
    const bool fine = folder_read(q->folder, index, buffer->bytes, sentence);
    if (!fine) {
        (void)fprintf(stderr, "tessera-replay: %s; the program gets a frame marked as broken\n",
                      sentence);
    }
    buffer->bytes_used = fine ? q->folder->format.image_bytes : 0;
    buffer->flags = fine ? 0 : V4L2_BUF_FLAG_ERROR;
    if (fault == FAULT_ERROR) {
        buffer->flags = V4L2_BUF_FLAG_ERROR;
    } else if (fault == FAULT_SHORT) {
        buffer->bytes_used /= 2;
    }
    buffer->sequence = (uint32_t)q->due;
    buffer->timestamp = stamp(&q->folder->frames[index], q->due / q->folder->count);
    buffer->state = DONE;
}

/* One frame comes due: into the first queued buffer, or past us. */
static void frame_due(void)
{
    const enum fault fault = faults_of(q->faults, q->due);
    if (fault == FAULT_UNPLUG) {
        q->unplugged = true;
        opens_post(q->owner);
        return;
    }
    if (q->queued.count > 0 && fault != FAULT_LOST) {
        const uint32_t index = delivery_pop(&q->queued);
        fill(&q->buffers[index], fault);
        delivery_push(&q->done, index);
        opens_post(q->owner);
    }
    q->due++;
    if (q->once && q->due == q->folder->count) {
        q->ended = true;
        opens_post(q->owner);
    }
}

static bool is_running(void)
{
    return q->streaming && !q->ended && !q->unplugged;
}

void delivery_fill_lockstep(void)
{
    while (q->period_ns == 0 && is_running() && q->queued.count > 0) {
        frame_due();
    }
}

static void *pace(void *unused)
{
    (void)unused;
    (void)pthread_mutex_lock(&q->lock);
    for (;;) {
        if (!is_running()) {
            (void)pthread_cond_wait(&q->changed, &q->lock);
            continue;
        }
        const int64_t next_ns = q->started_ns + (int64_t)(q->due + 1) * q->period_ns;
        if (now_ns() >= next_ns) {
            frame_due();
        } else {
            const struct timespec until = {.tv_sec = next_ns / 1000000000,
                                           .tv_nsec = next_ns % 1000000000};
            (void)pthread_cond_timedwait(&q->changed, &q->lock, &until);
        }
    }
    return NULL;
}

static bool have_thread(void)
{
    if (q->period_ns == 0 || q->paced_in == getpid()) {
        return true;
    }
    /* The program's signals are for the program's threads. */
    sigset_t all;
    sigset_t before;
    (void)sigfillset(&all);
    (void)pthread_sigmask(SIG_SETMASK, &all, &before);
    pthread_t thread;
    const bool created = pthread_create(&thread, NULL, pace, NULL) == 0;
    if (created) {
        (void)pthread_detach(thread);
        q->paced_in = getpid();
    }
    (void)pthread_sigmask(SIG_SETMASK, &before, NULL);
    return created;
}

bool delivery_stream_on(void)
{
    if (!have_thread()) {
        return false;
    }
    uint64_t count;
    const ssize_t taken = read(q->stopped_fd, &count, sizeof count);
    (void)taken; /* it does not block; afterwards the count is 0 either way */
    q->streaming = true;
    q->ended = false;
    q->due = 0;
    q->started_ns = now_ns();
    delivery_fill_lockstep();
    (void)pthread_cond_broadcast(&q->changed);
    return true;
}

void delivery_stream_off(void)
{
    if (q->streaming) {
        const uint64_t one = 1;
        const ssize_t written = write(q->stopped_fd, &one, sizeof one);
        (void)written; /* its count was 0, see delivery_stream_on */
        opens_drain(q->owner);
    }
    q->streaming = false;
    q->queued.count = 0;
    q->done.count = 0;
    for (uint32_t i = 0; i < q->count; i++) {
        q->buffers[i].state = IDLE;
    }
}
