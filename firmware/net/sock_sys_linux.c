/* The sender's system calls on Linux: TCP, without blocking. */
#include "firmware/net/sock_sys.h"

#include <errno.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

/* How long the kernel may hold bytes that nobody confirms before it calls the connection dead. */
enum { UNCONFIRMED_MS_MAX = 10000 };

static size_t resolve(const char *host, const char *port, struct sock_address *to, const char **why)
{
    const struct addrinfo hints = { .ai_socktype = SOCK_STREAM, .ai_flags = AI_NUMERICSERV };
    struct addrinfo *list = NULL;
    const int error = getaddrinfo(host, port, &hints, &list);
    if (error != 0) {
        *why = error == EAI_SYSTEM ? strerror(errno) : gai_strerror(error);
        return 0;
    }
    size_t count = 0;
    for (const struct addrinfo *at = list; at != NULL && count < SOCK_SYS_ADDRESSES_MAX;
         at = at->ai_next) {
        memcpy(&to[count].storage, at->ai_addr, at->ai_addrlen);
        to[count].bytes = at->ai_addrlen;
        count++;
    }
    freeaddrinfo(list);
    *why = "no address";
    return count;
}

static int begin_connect(const struct sock_address *address)
{
    const int kind = SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC;
    const int fd = socket(address->storage.ss_family, kind, 0);
    if (fd < 0) {
        return -errno;
    }
    /* Packets are whole messages, sent at once; a dead peer is to be noticed. A kernel that knows
     * one of these options not still sends. */
    const int yes = 1;
    const unsigned limit_ms = UNCONFIRMED_MS_MAX;
    (void)setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    (void)setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &yes, sizeof yes);
    (void)setsockopt(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, &limit_ms, sizeof limit_ms);
    if (connect(fd, (const struct sockaddr *)&address->storage, address->bytes) != 0 &&
        errno != EINPROGRESS) {
        const int error = errno;
        close(fd);
        return -error;
    }
    return fd;
}

static int connected(int fd)
{
    struct pollfd waiting = { .fd = fd, .events = POLLOUT };
    if (poll(&waiting, 1, 0) < 1) {
        return -EINPROGRESS;
    }
    int error = 0;
    socklen_t bytes = sizeof error;
    if (getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &bytes) != 0) {
        return -errno;
    }
    return -error;
}

static ptrdiff_t send_some(int fd, const uint8_t *bytes, size_t count)
{
    const ssize_t sent = send(fd, bytes, count, MSG_NOSIGNAL);
    if (sent >= 0) {
        return sent > 0 ? sent : -EAGAIN;
    }
    return errno == EINTR || errno == EWOULDBLOCK ? -EAGAIN : -errno;
}

static int peer(int fd)
{
    char unwanted[256];
    for (int i = 0; i < 64; i++) {
        const ssize_t got = recv(fd, unwanted, sizeof unwanted, MSG_DONTWAIT);
        if (got == 0) {
            return -EPIPE;
        }
        if (got < 0) {
            return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR ? 0 : -errno;
        }
    }
    return 0;
}

static int unconfirmed(int fd)
{
    int bytes = 0;
    return ioctl(fd, TIOCOUTQ, &bytes) == 0 ? bytes : -errno;
}

static void wait_writable(int fd, uint32_t timeout_ms)
{
    struct pollfd waiting = { .fd = fd, .events = POLLOUT };
    (void)poll(&waiting, fd >= 0 ? 1 : 0, (int)(timeout_ms < 1000000 ? timeout_ms : 1000000));
}

static void close_fd(int fd)
{
    (void)close(fd);
}

static int64_t now_ms(void)
{
    struct timespec now = { 0 };
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

static const char *error_text(int error)
{
    return strerror(error);
}

const struct sock_sys sock_sys_linux = {
    .resolve = resolve,
    .connect = begin_connect,
    .connected = connected,
    .send = send_some,
    .peer = peer,
    .unconfirmed = unconfirmed,
    .wait = wait_writable,
    .close = close_fd,
    .now_ms = now_ms,
    .error_text = error_text,
};
