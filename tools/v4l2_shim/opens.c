/* A table from descriptor to opening. */
#include "tools/v4l2_shim/opens.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdlib.h>
#include <sys/eventfd.h>
#include <unistd.h>

enum {
    DESCRIPTORS_MAX = 65536, /* beyond every usual limit; a higher one cannot be an opening */
    OPENINGS_MAX = 1024,
    OWN_FD_MIN = 100, /* our own descriptors keep clear of the small numbers that scripts use */
};

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static _Atomic(struct opening *) table[DESCRIPTORS_MAX];
static struct opening openings[OPENINGS_MAX];

struct opening *opens_of(int fd)
{
    if (fd < 0 || fd >= DESCRIPTORS_MAX) {
        return NULL;
    }
    return atomic_load_explicit(&table[fd], memory_order_acquire);
}

int opens_add(int flags)
{
    const int event_flags = EFD_SEMAPHORE | ((flags & O_NONBLOCK) != 0 ? EFD_NONBLOCK : 0) |
                            ((flags & O_CLOEXEC) != 0 ? EFD_CLOEXEC : 0);
    const int fd = eventfd(0, event_flags);
    if (fd < 0 || fd >= DESCRIPTORS_MAX) {
        return -1;
    }
    const int own_fd = fcntl(fd, F_DUPFD_CLOEXEC, OWN_FD_MIN);
    struct opening *made = NULL;
    (void)pthread_mutex_lock(&lock);
    for (size_t i = 0; own_fd >= 0 && made == NULL && i < OPENINGS_MAX; i++) {
        made = openings[i].descriptors == 0 ? &openings[i] : NULL;
    }
    if (made != NULL) {
        *made = (struct opening){
            .descriptors = 1, .event_fd = own_fd, .priority = V4L2_PRIORITY_DEFAULT};
        atomic_store_explicit(&table[fd], made, memory_order_release);
    }
    (void)pthread_mutex_unlock(&lock);
    if (made == NULL) {
        (void)close(fd);
        if (own_fd >= 0) {
            (void)close(own_fd);
        }
        errno = EMFILE;
        return -1;
    }
    return fd;
}

void opens_note_copy(int fd, int copy)
{
    if (copy < 0 || copy >= DESCRIPTORS_MAX || opens_of(fd) == NULL) {
        return;
    }
    (void)pthread_mutex_lock(&lock);
    struct opening *const opening = opens_of(fd);
    if (opening != NULL) {
        opening->descriptors++;
        atomic_store_explicit(&table[copy], opening, memory_order_release);
    }
    (void)pthread_mutex_unlock(&lock);
}

void opens_forget(int fd, void (*last)(const struct opening *))
{
    if (opens_of(fd) == NULL) {
        return;
    }
    (void)pthread_mutex_lock(&lock);
    struct opening *const opening = opens_of(fd);
    bool was_last = false;
    if (opening != NULL) {
        atomic_store_explicit(&table[fd], NULL, memory_order_release);
        was_last = opening->descriptors == 1;
        if (!was_last) {
            opening->descriptors--;
        }
    }
    (void)pthread_mutex_unlock(&lock);
    if (was_last) {
        /* The slot stays taken until nothing refers to it any more. */
        last(opening);
        (void)close(opening->event_fd);
        (void)pthread_mutex_lock(&lock);
        opening->descriptors = 0;
        (void)pthread_mutex_unlock(&lock);
    }
}

uint32_t opens_priority(void)
{
    uint32_t highest = 0;
    (void)pthread_mutex_lock(&lock);
    for (size_t i = 0; i < OPENINGS_MAX; i++) {
        if (openings[i].descriptors > 0 && openings[i].priority > highest) {
            highest = openings[i].priority;
        }
    }
    (void)pthread_mutex_unlock(&lock);
    return highest;
}

void opens_post(const struct opening *opening)
{
    const uint64_t one = 1;
    const ssize_t written = write(opening->event_fd, &one, sizeof one);
    (void)written; /* it can only fail after 2^64 - 2 frames that nobody took */
}

static bool take(const struct opening *opening)
{
    /* The program decides whether the descriptor blocks, so ask before reading. */
    struct pollfd ready = {.fd = opening->event_fd, .events = POLLIN};
    uint64_t one;
    return poll(&ready, 1, 0) == 1 && read(opening->event_fd, &one, sizeof one) == sizeof one;
}

void opens_take(const struct opening *opening)
{
    (void)take(opening);
}

void opens_drain(const struct opening *opening)
{
    while (take(opening)) {
    }
}
