/* poll and select, put in front of libc's, for what the eventfd behind a device cannot say itself:
 * a device that does not stream is in error, and a camera can never be written to. */
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <sys/select.h>
#include <time.h>

#include "tools/v4l2_shim/interposed.h"
#include "tools/v4l2_shim/opens.h"
#include "tools/v4l2_shim/vqueue.h"

/* What fortified programs call; no header declares them. */
int __poll_chk(struct pollfd *fds, nfds_t count, int timeout_ms, size_t bytes);
int __ppoll_chk(struct pollfd *fds, nfds_t count, const struct timespec *timeout,
                const sigset_t *mask, size_t bytes);

enum { POLLED_MAX = 1024 };

static bool polls_ours(const struct pollfd *fds, nfds_t count)
{
    bool ours = false;
    for (nfds_t i = 0; i < count && !ours; i++) {
        ours = opens_of(fds[i].fd) != NULL;
    }
    /* More at once than anybody waits for: then natively, as epoll does it. */
    return ours && count <= POLLED_MAX;
}

static int poll_ours(struct pollfd *fds, nfds_t count, const struct timespec *timeout,
                     const sigset_t *mask)
{
    short asked[POLLED_MAX];
    bool idle = false;
    for (nfds_t i = 0; i < count; i++) {
        asked[i] = fds[i].events;
        if (opens_of(fds[i].fd) != NULL) {
            const bool for_input = (asked[i] & (POLLIN | POLLRDNORM)) != 0;
            idle = idle || !vqueue_is_streaming();
            fds[i].events = for_input ? POLLIN : 0;
        }
    }
    const struct timespec at_once = {0};
    int ready = NEXT(ppoll)(fds, count, idle ? &at_once : timeout, mask);
    for (nfds_t i = 0; i < count; i++) {
        fds[i].events = asked[i];
        if (ready >= 0 && opens_of(fds[i].fd) != NULL) {
            const bool was_ready = fds[i].revents != 0;
            if (idle) {
                fds[i].revents = POLLERR;
            } else if ((fds[i].revents & POLLIN) != 0) {
                fds[i].revents = (short)(asked[i] & (POLLIN | POLLRDNORM));
            }
            ready += !was_ready && fds[i].revents != 0 ? 1 : 0;
        }
    }
    return ready;
}

INTERPOSED int ppoll(struct pollfd *fds, nfds_t count, const struct timespec *timeout,
                     const sigset_t *mask)
{
    return polls_ours(fds, count) ? poll_ours(fds, count, timeout, mask)
                                  : NEXT(ppoll)(fds, count, timeout, mask);
}

INTERPOSED int poll(struct pollfd *fds, nfds_t count, int timeout_ms)
{
    if (!polls_ours(fds, count)) {
        return NEXT(poll)(fds, count, timeout_ms);
    }
    const struct timespec timeout = {.tv_sec = timeout_ms / 1000,
                                     .tv_nsec = timeout_ms % 1000 * 1000000L};
    return poll_ours(fds, count, timeout_ms < 0 ? NULL : &timeout, NULL);
}

INTERPOSED int __poll_chk(struct pollfd *fds, nfds_t count, int timeout_ms, size_t bytes)
{
    return polls_ours(fds, count) ? poll(fds, count, timeout_ms)
                                  : NEXT(__poll_chk)(fds, count, timeout_ms, bytes);
}

INTERPOSED int __ppoll_chk(struct pollfd *fds, nfds_t count, const struct timespec *timeout,
                           const sigset_t *mask, size_t bytes)
{
    return polls_ours(fds, count) ? poll_ours(fds, count, timeout, mask)
                                  : NEXT(__ppoll_chk)(fds, count, timeout, mask, bytes);
}

/* The idle devices among what select() was asked for. */
struct idle {
    fd_set readable;
    fd_set writable;
    int    count;
};

/* Takes from set what the eventfd must not answer for, and notes the idle devices in it. */
static void take_ours(int limit, fd_set *set, bool all, fd_set *idle, int *idle_count)
{
    for (int fd = 0; set != NULL && fd < limit && fd < FD_SETSIZE; fd++) {
        if (FD_ISSET(fd, set) && opens_of(fd) != NULL) {
            const bool is_idle = !vqueue_is_streaming();
            if (is_idle && idle != NULL) {
                FD_SET(fd, idle);
                (*idle_count)++;
            }
            if (is_idle || all) {
                FD_CLR(fd, set);
            }
        }
    }
}

static struct idle take_idle(int limit, fd_set *readable, fd_set *writable, fd_set *special)
{
    struct idle idle = {.count = 0};
    FD_ZERO(&idle.readable);
    FD_ZERO(&idle.writable);
    take_ours(limit, readable, false, &idle.readable, &idle.count);
    take_ours(limit, writable, true, &idle.writable, &idle.count);
    take_ours(limit, special, true, NULL, NULL);
    return idle;
}

/* A device in error is readable and writable for select(). */
static int give_back(const struct idle *idle, int limit, fd_set *readable, fd_set *writable,
                     int ready)
{
    for (int fd = 0; ready >= 0 && idle->count > 0 && fd < limit && fd < FD_SETSIZE; fd++) {
        if (FD_ISSET(fd, &idle->readable)) {
            FD_SET(fd, readable);
            ready++;
        }
        if (FD_ISSET(fd, &idle->writable)) {
            FD_SET(fd, writable);
            ready++;
        }
    }
    return ready;
}

INTERPOSED int select(int limit, fd_set *restrict readable, fd_set *restrict writable,
                      fd_set *restrict special, struct timeval *restrict timeout)
{
    const struct idle idle = take_idle(limit, readable, writable, special);
    struct timeval at_once = {0};
    const int ready =
        NEXT(select)(limit, readable, writable, special, idle.count > 0 ? &at_once : timeout);
    return give_back(&idle, limit, readable, writable, ready);
}

INTERPOSED int pselect(int limit, fd_set *restrict readable, fd_set *restrict writable,
                       fd_set *restrict special, const struct timespec *restrict timeout,
                       const sigset_t *restrict mask)
{
    const struct idle idle = take_idle(limit, readable, writable, special);
    const struct timespec at_once = {0};
    const int ready = NEXT(pselect)(limit, readable, writable, special,
                                    idle.count > 0 ? &at_once : timeout, mask);
    return give_back(&idle, limit, readable, writable, ready);
}
