/* The device's buffers: allocation, the way from queued to done, and who may touch them.
 *
 * Functions answer like the kernel's: 0 or an errno. All of them may be called from any thread. */
#ifndef TESSERA_V4L2_SHIM_VQUEUE_H
#define TESSERA_V4L2_SHIM_VQUEUE_H

#include <linux/videodev2.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "tools/v4l2_shim/opens.h"

/* Buffers exist, so the format cannot change. */
bool vqueue_is_busy(void);
bool vqueue_is_streaming(void);
/* The device was unplugged: every ioctl answers ENODEV. */
bool vqueue_is_gone(void);

int vqueue_request(const struct opening *by, struct v4l2_requestbuffers *io);
int vqueue_create(const struct opening *by, struct v4l2_create_buffers *io);
int vqueue_query(struct v4l2_buffer *io);
int vqueue_prepare(const struct opening *by, struct v4l2_buffer *io);
int vqueue_queue(const struct opening *by, struct v4l2_buffer *io);
int vqueue_dequeue(const struct opening *by, struct v4l2_buffer *io);
int vqueue_export(const struct opening *by, struct v4l2_exportbuffer *io);
int vqueue_stream_on(const struct opening *by, uint32_t type);
int vqueue_stream_off(const struct opening *by, uint32_t type);

/* A descriptor of the memory of the buffer at this offset and of at least this length, for mmap; or
 * -1. It stays the queue's. */
int vqueue_memory_at(uint64_t offset, size_t length);

/* The opening goes: end its stream and free its buffers. */
void vqueue_leave(const struct opening *by);

#endif
