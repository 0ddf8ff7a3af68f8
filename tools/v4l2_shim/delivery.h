/* The buffers on their way: which are queued, which hold a frame, and what fills them.
 *
 * vqueue.c answers the program and shares this state; the lock is held for all of it, except in
 * delivery_start. */
#ifndef TESSERA_V4L2_SHIM_DELIVERY_H
#define TESSERA_V4L2_SHIM_DELIVERY_H

#include <linux/videodev2.h>
#include <pthread.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/time.h>
#include <sys/types.h>

#include "tools/v4l2_shim/faults.h"
#include "tools/v4l2_shim/folder.h"
#include "tools/v4l2_shim/opens.h"

enum { BUFFERS_MAX = VIDEO_MAX_FRAME };

enum state { IDLE, PREPARED, QUEUED, DONE };

struct buffer {
    enum state     state;
    int            memory_fd; /* MMAP: the memory; -1 otherwise */
    uint8_t       *bytes;     /* MMAP: our mapping of it; USERPTR: the program's memory */
    size_t         length;
    uint64_t       offset; /* MMAP: what the program passes to mmap */
    uint32_t       bytes_used;
    uint32_t       flags; /* V4L2_BUF_FLAG_ERROR or nothing */
    uint32_t       sequence;
    struct timeval timestamp;
};

/* First in, first out, of buffer indices. */
struct line {
    uint32_t at[BUFFERS_MAX];
    uint32_t count;
};

struct delivery {
    pthread_mutex_t       lock;
    pthread_cond_t        changed; /* streaming began: the pacing thread has work */
    const struct folder  *folder;
    const struct faults  *faults;
    int64_t               period_ns; /* 0: lockstep */
    bool                  once;
    const struct opening *owner; /* whose buffers they are; NULL: nobody's */
    uint32_t              memory;
    struct buffer         buffers[BUFFERS_MAX];
    uint32_t              count;
    struct line           queued;
    struct line           done;
    bool                  streaming;
    bool                  ended;      /* once: all frames are out */
    bool                  unplugged;  /* gone for good, as soon as no frame waits */
    pid_t                 paced_in;   /* process with the pacing thread, which fork leaves out */
    uint64_t              due;        /* frames that came due since STREAMON, dropped ones too */
    int64_t               started_ns;
    int                   stopped_fd; /* readable while not streaming: wakes a waiting DQBUF */
};

extern struct delivery delivery;

/* Once, before all else. */
void delivery_start(const struct folder *folder, const struct faults *faults, int64_t period_ns,
                    bool once);

void     delivery_push(struct line *line, uint32_t index);
uint32_t delivery_pop(struct line *line);

/* Unplugged, and no frame waits any more. */
bool delivery_is_gone(void);

/* STREAMON: from the first frame. False where the pacing thread cannot be had. */
bool delivery_stream_on(void);

/* STREAMOFF: every buffer is the program's again. */
void delivery_stream_off(void);

/* In lockstep, gives every queued buffer its frame. */
void delivery_fill_lockstep(void);

#endif
