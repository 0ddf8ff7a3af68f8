/* The V4L2 backend's system calls on Linux. */
#include "firmware/capture/v4l2_sys.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <poll.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

static int open_device(const char *path)
{
    const int fd = open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC);
    return fd < 0 ? -errno : fd;
}

static int ioctl_again(int fd, unsigned long request, void *argument)
{
    int answer = -1;
    do {
        answer = ioctl(fd, request, argument);
    } while (answer < 0 && errno == EINTR);
    return answer < 0 ? -errno : answer;
}

static int wait_readable(int fd, uint32_t timeout_ms)
{
    struct pollfd waiting = { .fd = fd, .events = POLLIN };
    const int ready = poll(&waiting, 1, timeout_ms > INT_MAX ? INT_MAX : (int)timeout_ms);
    if (ready < 0) {
        return errno == EINTR ? 0 : -errno;
    }
    if ((waiting.revents & POLLIN) != 0) {
        return 1;
    }
    return ready == 0 ? 0 : -EIO;
}

static int map(int fd, uint32_t offset, size_t bytes, const uint8_t **out)
{
    void *const memory = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, (off_t)offset);
    if (memory == MAP_FAILED) {
        return -errno;
    }
    *out = memory;
    return 0;
}

static void unmap(const uint8_t *memory, size_t bytes)
{
    (void)munmap((void *)(uintptr_t)memory, bytes);
}

static void close_device(int fd)
{
    (void)close(fd);
}

static const char *error_text(int error)
{
    return strerror(error);
}

const struct v4l2_sys v4l2_sys_linux = {
    .open = open_device,
    .ioctl = ioctl_again,
    .wait = wait_readable,
    .map = map,
    .unmap = unmap,
    .close = close_device,
    .error_text = error_text,
};
