/* The calls that use an open device, put in front of libc's: ioctl, mmap, and libv4l2's syscall. */
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "tools/v4l2_shim/answers.h"
#include "tools/v4l2_shim/interposed.h"
#include "tools/v4l2_shim/opens.h"
#include "tools/v4l2_shim/vqueue.h"

INTERPOSED int ioctl(int fd, unsigned long request, ...)
{
    va_list rest;
    va_start(rest, request);
    void *const argument = va_arg(rest, void *);
    va_end(rest);
    struct opening *const opening = opens_of(fd);
    if (opening == NULL) {
        return NEXT(ioctl)(fd, request, argument);
    }
    /* Some programs pass the request as a negative int. */
    const int answer = answers_ioctl(opening, (unsigned int)request, argument);
    if (answer != 0) {
        errno = answer;
        return -1;
    }
    return 0;
}

#define DEFINE_MMAP(name, offset_type)                                                             \
    INTERPOSED void *name(void *at, size_t length, int protection, int flags, int fd,              \
                          offset_type offset)                                                      \
    {                                                                                              \
        if (opens_of(fd) == NULL) {                                                                \
            return NEXT(name)(at, length, protection, flags, fd, offset);                          \
        }                                                                                          \
        const int memory_fd = vqueue_memory_at((uint64_t)offset, length);                          \
        if (memory_fd < 0 || (flags & MAP_SHARED) == 0) {                                          \
            errno = EINVAL;                                                                        \
            return MAP_FAILED;                                                                     \
        }                                                                                          \
        return NEXT(name)(at, length, protection, flags, memory_fd, 0);                            \
    }
DEFINE_MMAP(mmap, off_t)
DEFINE_MMAP(mmap64, off64_t)

/* libv4l2 goes past libc's functions, but still through this one. */
INTERPOSED long syscall(long number, ...)
{
    long a[6];
    va_list rest;
    va_start(rest, number);
    for (int i = 0; i < 6; i++) {
        a[i] = va_arg(rest, long);
    }
    va_end(rest);
    switch (number) {
#ifdef SYS_open
    case SYS_open:
        return open((const char *)a[0], (int)a[1], (mode_t)a[2]);
#endif
    case SYS_openat:
        return openat((int)a[0], (const char *)a[1], (int)a[2], (mode_t)a[3]);
    case SYS_close:
        return close((int)a[0]);
    case SYS_ioctl:
        return ioctl((int)a[0], (unsigned long)a[1], (void *)a[2]);
#ifdef SYS_mmap
    case SYS_mmap:
        return (long)mmap((void *)a[0], (size_t)a[1], (int)a[2], (int)a[3], (int)a[4], a[5]);
#endif
    default:
        return NEXT(syscall)(number, a[0], a[1], a[2], a[3], a[4], a[5]);
    }
}
