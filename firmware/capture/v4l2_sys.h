/* The few calls that the V4L2 backend makes into the operating system, as a table, so that tests
 * can put a scripted device in their place. Failures are negative errno values. */
#ifndef TESSERA_FIRMWARE_CAPTURE_V4L2_SYS_H
#define TESSERA_FIRMWARE_CAPTURE_V4L2_SYS_H

#include <stddef.h>
#include <stdint.h>

struct v4l2_sys {
    /* A descriptor, for reading and writing, that does not block. */
    int (*open)(const char *path);
    /* 0 or more. Not ended by a signal. */
    int (*ioctl)(int fd, unsigned long request, void *argument);
    /* 1 when there is a frame to dequeue; 0 after so long without one, or after a signal; -EIO when
     * the device is in error, and dequeuing may say why. */
    int (*wait)(int fd, uint32_t timeout_ms);
    /* 0, with the memory at offset in *out. */
    int (*map)(int fd, uint32_t offset, size_t bytes, const uint8_t **out);
    void (*unmap)(const uint8_t *memory, size_t bytes);
    void (*close)(int fd);
    /* Text for an errno value. */
    const char *(*error_text)(int error);
};

/* Linux. */
extern const struct v4l2_sys v4l2_sys_linux;

#endif
