/* The program's file descriptors that stand for the device.
 *
 * V4L2 ties buffers to an open file description, which dup() shares, so descriptors are counted per
 * opening. Each one is really an eventfd whose count is the number of frames ready (plus one when
 * the stream has ended): the program's own poll, select and epoll then work on it natively. */
#ifndef TESSERA_V4L2_SHIM_OPENS_H
#define TESSERA_V4L2_SHIM_OPENS_H

#include <stdbool.h>
#include <stdint.h>

struct opening {
    int      descriptors; /* the program's, that refer to it                                */
    int      event_fd;    /* our own descriptor of the same eventfd, not in the table        */
    uint32_t priority;    /* enum v4l2_priority                                              */
};

/* Makes an opening with open()'s flags; its descriptor, or -1 with errno. */
int opens_add(int flags);

/* The opening behind fd, or NULL where fd is none of ours. Takes no lock. */
struct opening *opens_of(int fd);

/* Notes that copy, fresh from dup() or its kin, refers to what fd refers to. */
void opens_note_copy(int fd, int copy);

/* To be called before fd is closed. Where it was the last descriptor, frees the opening, after
 * last(opening). Nothing where fd is none of ours. */
void opens_forget(int fd, void (*last)(const struct opening *));

/* The highest priority that any opening holds; 0 where none does. */
uint32_t opens_priority(void);

/* One more frame ready; one frame taken; none ready. */
void opens_post(const struct opening *opening);
void opens_take(const struct opening *opening);
void opens_drain(const struct opening *opening);

#endif
