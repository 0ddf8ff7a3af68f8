/* The device's answers to ioctl. */
#ifndef TESSERA_V4L2_SHIM_ANSWERS_H
#define TESSERA_V4L2_SHIM_ANSWERS_H

#include "tools/v4l2_shim/folder.h"
#include "tools/v4l2_shim/opens.h"

/* Once, before the first ioctl. The folder must outlive the answers. period_ns 0: lockstep. */
void answers_start(const struct folder *folder, int64_t period_ns);

/* 0 or an errno, as the kernel would answer. */
int answers_ioctl(struct opening *by, unsigned int request, void *argument);

#endif
