/* The calls that open, examine and close files, put in front of libc's. */
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include "tools/v4l2_shim/interposed.h"
#include "tools/v4l2_shim/opens.h"
#include "tools/v4l2_shim/shim_device.h"

/* What fortified programs call instead of open(); no header declares them. */
int __open_2(const char *path, int flags);
int __open64_2(const char *path, int flags);
int __openat_2(int folder, const char *path, int flags);
int __openat64_2(int folder, const char *path, int flags);

/* True where path is ours, and then *fd is what open() answers. */
static bool open_ours(const char *path, int flags, int *fd)
{
    if (shim_device_is(path)) {
        *fd = shim_device_open(flags);
        return true;
    }
    if (shim_device_is_uevent(path)) {
        *fd = shim_device_open_uevent();
        return true;
    }
    return false;
}

static mode_t mode_of(int flags, va_list rest)
{
    return (flags & O_CREAT) != 0 || (flags & O_TMPFILE) == O_TMPFILE ? va_arg(rest, mode_t) : 0;
}

#define DEFINE_OPEN(name)                                                                          \
    INTERPOSED int name(const char *path, int flags, ...)                                          \
    {                                                                                              \
        va_list rest;                                                                              \
        va_start(rest, flags);                                                                     \
        const mode_t mode = mode_of(flags, rest);                                                  \
        va_end(rest);                                                                              \
        int fd;                                                                                    \
        return open_ours(path, flags, &fd) ? fd : NEXT(name)(path, flags, mode);                   \
    }
DEFINE_OPEN(open)
DEFINE_OPEN(open64)

#define DEFINE_OPENAT(name)                                                                        \
    INTERPOSED int name(int folder, const char *path, int flags, ...)                              \
    {                                                                                              \
        va_list rest;                                                                              \
        va_start(rest, flags);                                                                     \
        const mode_t mode = mode_of(flags, rest);                                                  \
        va_end(rest);                                                                              \
        int fd;                                                                                    \
        return open_ours(path, flags, &fd) ? fd : NEXT(name)(folder, path, flags, mode);           \
    }
DEFINE_OPENAT(openat)
DEFINE_OPENAT(openat64)

#define DEFINE_OPEN_2(name)                                                                        \
    INTERPOSED int name(const char *path, int flags)                                               \
    {                                                                                              \
        int fd;                                                                                    \
        return open_ours(path, flags, &fd) ? fd : NEXT(name)(path, flags);                         \
    }
DEFINE_OPEN_2(__open_2)
DEFINE_OPEN_2(__open64_2)

#define DEFINE_OPENAT_2(name)                                                                      \
    INTERPOSED int name(int folder, const char *path, int flags)                                   \
    {                                                                                              \
        int fd;                                                                                    \
        return open_ours(path, flags, &fd) ? fd : NEXT(name)(folder, path, flags);                 \
    }
DEFINE_OPENAT_2(__openat_2)
DEFINE_OPENAT_2(__openat64_2)

#define DEFINE_FOPEN(name)                                                                         \
    INTERPOSED FILE *name(const char *path, const char *mode)                                      \
    {                                                                                              \
        if (shim_device_is_uevent(path)) {                                                         \
            const int fd = shim_device_open_uevent();                                              \
            return fd < 0 ? NULL : fdopen(fd, "r");                                                \
        }                                                                                          \
        return NEXT(name)(path, mode);                                                             \
    }
DEFINE_FOPEN(fopen)
DEFINE_FOPEN(fopen64)

INTERPOSED int close(int fd)
{
    shim_device_closing(fd);
    return NEXT(close)(fd);
}

INTERPOSED int close_range(unsigned int first, unsigned int last, int flags)
{
    enum { DESCRIPTORS_MAX = 65536 };
    for (unsigned int fd = first; flags == 0 && fd <= last && fd < DESCRIPTORS_MAX; fd++) {
        shim_device_closing((int)fd);
    }
    return NEXT(close_range)(first, last, flags);
}

INTERPOSED int dup(int fd)
{
    const int copy = NEXT(dup)(fd);
    opens_note_copy(fd, copy);
    return copy;
}

/* The target, where it is open, is closed by the kernel. */
static void note_replaced(int fd, int copy, int target)
{
    if (copy >= 0 && fd != target) {
        shim_device_closing(target);
        opens_note_copy(fd, copy);
    }
}

INTERPOSED int dup2(int fd, int target)
{
    const int copy = NEXT(dup2)(fd, target);
    note_replaced(fd, copy, target);
    return copy;
}

INTERPOSED int dup3(int fd, int target, int flags)
{
    const int copy = NEXT(dup3)(fd, target, flags);
    note_replaced(fd, copy, target);
    return copy;
}

#define DEFINE_FCNTL(name)                                                                         \
    INTERPOSED int name(int fd, int command, ...)                                                  \
    {                                                                                              \
        va_list rest;                                                                              \
        va_start(rest, command);                                                                   \
        void *const argument = va_arg(rest, void *);                                               \
        va_end(rest);                                                                              \
        const int answer = NEXT(name)(fd, command, argument);                                      \
        if (command == F_DUPFD || command == F_DUPFD_CLOEXEC) {                                    \
            opens_note_copy(fd, answer);                                                           \
        }                                                                                          \
        return answer;                                                                             \
    }
DEFINE_FCNTL(fcntl)
DEFINE_FCNTL(fcntl64)

/* struct stat and struct stat64 are one type by two names where off_t has 64 bits. */
_Static_assert(sizeof(struct stat) == sizeof(struct stat64), "a 64-bit off_t");

#define DEFINE_STAT(name, type)                                                                    \
    INTERPOSED int name(const char *path, struct type *out)                                        \
    {                                                                                              \
        if (shim_device_is(path)) {                                                                \
            shim_device_stat((struct stat *)out);                                                  \
            return 0;                                                                              \
        }                                                                                          \
        return NEXT(name)(path, out);                                                              \
    }
DEFINE_STAT(stat, stat)
DEFINE_STAT(stat64, stat64)
DEFINE_STAT(lstat, stat)
DEFINE_STAT(lstat64, stat64)

#define DEFINE_FSTAT(name, type)                                                                   \
    INTERPOSED int name(int fd, struct type *out)                                                  \
    {                                                                                              \
        if (opens_of(fd) != NULL) {                                                                \
            shim_device_stat((struct stat *)out);                                                  \
            return 0;                                                                              \
        }                                                                                          \
        return NEXT(name)(fd, out);                                                                \
    }
DEFINE_FSTAT(fstat, stat)
DEFINE_FSTAT(fstat64, stat64)

#define DEFINE_FSTATAT(name, type)                                                                 \
    INTERPOSED int name(int folder, const char *path, struct type *out, int flags)                 \
    {                                                                                              \
        if (shim_device_is(path)) {                                                                \
            shim_device_stat((struct stat *)out);                                                  \
            return 0;                                                                              \
        }                                                                                          \
        return NEXT(name)(folder, path, out, flags);                                               \
    }
DEFINE_FSTATAT(fstatat, stat)
DEFINE_FSTATAT(fstatat64, stat64)

INTERPOSED int statx(int folder, const char *path, int flags, unsigned int mask, struct statx *out)
{
    if (!shim_device_is(path)) {
        return NEXT(statx)(folder, path, flags, mask, out);
    }
    struct stat device;
    shim_device_stat(&device);
    memset(out, 0, sizeof *out);
    out->stx_mask = STATX_TYPE | STATX_MODE | STATX_NLINK | STATX_INO | STATX_UID | STATX_GID;
    out->stx_mode = (uint16_t)device.st_mode;
    out->stx_nlink = (uint32_t)device.st_nlink;
    out->stx_ino = device.st_ino;
    out->stx_uid = device.st_uid;
    out->stx_gid = device.st_gid;
    out->stx_blksize = (uint32_t)device.st_blksize;
    out->stx_rdev_major = major(device.st_rdev);
    out->stx_rdev_minor = minor(device.st_rdev);
    return 0;
}

INTERPOSED int access(const char *path, int how)
{
    return shim_device_is(path) ? 0 : NEXT(access)(path, how);
}

INTERPOSED int faccessat(int folder, const char *path, int how, int flags)
{
    return shim_device_is(path) ? 0 : NEXT(faccessat)(folder, path, how, flags);
}
