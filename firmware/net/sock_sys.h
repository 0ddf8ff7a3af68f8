/* The few calls that the sender makes into the operating system, as a table, so that tests can
 * put a scripted network in their place. Failures are negative errno values, unless said
 * otherwise. */
#ifndef TESSERA_FIRMWARE_NET_SOCK_SYS_H
#define TESSERA_FIRMWARE_NET_SOCK_SYS_H

#include <stddef.h>
#include <stdint.h>
#include <sys/socket.h>

#define SOCK_SYS_ADDRESSES_MAX 8u

struct sock_address {
    struct sockaddr_storage storage;
    socklen_t bytes;
};

struct sock_sys {
    /* Addresses of a host and a numeric port, at most SOCK_SYS_ADDRESSES_MAX; their count, or 0
     * with the reason in `*why` (text that stays). The only call that may block for long or use
     * the heap. */
    size_t (*resolve)(const char *host, const char *port, struct sock_address *to,
                      const char **why);
    /* Begins a connection without waiting for it; a descriptor. */
    int (*connect)(const struct sock_address *address);
    /* 0 when a begun connection stands, -EINPROGRESS while it is under way. */
    int (*connected)(int fd);
    /* Bytes taken, at least 1; -EAGAIN when none can be. */
    ptrdiff_t (*send)(int fd, const uint8_t *bytes, size_t count);
    /* 0 while the other side keeps the connection, -EPIPE when it has closed it. Throws away what
     * the other side may have sent. */
    int (*peer)(int fd);
    /* Bytes taken that the other side has not confirmed yet. */
    int (*unconfirmed)(int fd);
    /* Waits until `fd` can take bytes or its connection ends, at most so long; -1: only waits. */
    void (*wait)(int fd, uint32_t timeout_ms);
    void (*close)(int fd);
    /* Monotonic. */
    int64_t (*now_ms)(void);
    /* Text for an errno value. */
    const char *(*error_text)(int error);
};

/* TCP on Linux. */
extern const struct sock_sys sock_sys_linux;

#endif
