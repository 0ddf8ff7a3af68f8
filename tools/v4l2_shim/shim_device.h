/* The one device that this process is shown. */
#ifndef TESSERA_V4L2_SHIM_SHIM_DEVICE_H
#define TESSERA_V4L2_SHIM_SHIM_DEVICE_H

#include <stdbool.h>
#include <sys/stat.h>

/* path names the device. False for all paths where no folder is to be shown. */
bool shim_device_is(const char *path);

/* path is where a program looks up the device's name in sysfs. */
bool shim_device_is_uevent(const char *path);

/* A descriptor to read that file from, or -1 with errno. */
int shim_device_open_uevent(void);

/* open() on the device: a descriptor that opens_of knows, or -1 with errno. */
int shim_device_open(int flags);

/* close() is about to close fd. */
void shim_device_closing(int fd);

/* What stat() says of the device. */
void shim_device_stat(struct stat *out);

#endif
