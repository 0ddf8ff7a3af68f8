/* Sends whole packets to one receiver over TCP, without ever blocking the frame loop.
 *
 * Packets wait in a ring of the caller's memory. When it is full the oldest is dropped and
 * counted: a camera's newest frame is worth most. A lost connection is made again, waiting longer
 * each time; the packet that was under way is sent again from its start, so that a receiver sees
 * whole packets only. */
#ifndef TESSERA_FIRMWARE_NET_SENDER_H
#define TESSERA_FIRMWARE_NET_SENDER_H

#include "firmware/net/sock_sys.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define SENDER_CONNECT_MS 3000u      /* one address that does not answer */
#define SENDER_BACKOFF_MS_MIN 100u   /* first wait between attempts; doubles ... */
#define SENDER_BACKOFF_MS_MAX 5000u  /* ... up to this */

struct sender_options {
    const char *to;                  /* HOST:PORT, a name, IPv4 or [IPv6] */
    uint32_t give_up_ms;             /* so long without a connection is a failure; 0: never */
    size_t   packet_bytes_max;       /* a longer packet is dropped */
    uint8_t *memory;                 /* packet under way, then the ring; stays the caller's */
    size_t   memory_bytes;           /* above packet_bytes_max; a queued packet takes 4 more */
};

struct sender_counters {
    uint64_t packets_sent, bytes_sent;   /* handed to the kernel whole */
    uint64_t packets_dropped;            /* ring full, too long, or left over at the end */
    uint32_t connections;                /* made since start */
};

enum sender_state { SENDER_WAITS, SENDER_CONNECTS, SENDER_STANDS, SENDER_GAVE_UP };

/* All fields are the sender's own; read `counters` and `state`. */
struct sender {
    const struct sock_sys *sys;
    struct sender_options options;
    struct sender_counters counters;
    enum sender_state state;
    char host[256], port[8];
    char sentence[512];
    struct sock_address addresses[SOCK_SYS_ADDRESSES_MAX];
    size_t address_count, address_index;
    int fd;
    int64_t apart_since_ms;          /* when there was last a connection, or start */
    int64_t next_attempt_ms, attempt_ends_ms;
    uint32_t backoff_ms;
    size_t under_way_bytes, under_way_sent;  /* 0: nothing under way */
    size_t ring_bytes, ring_first, ring_used;
};

/* Sets up and makes the first attempt; does not wait for it. False where `to` is not HOST:PORT or
 * the memory is too small; then sender_sentence says what is wrong. `sys` is &sock_sys_linux. */
bool sender_open(struct sender *sender, const struct sock_sys *sys,
                 const struct sender_options *options);

/* Queues a copy of one whole packet, dropping the oldest where there is no room. */
void sender_offer(struct sender *sender, const uint8_t *packet, size_t bytes);

/* Whether sender_offer would drop nothing; sources that can wait (recordings) poll until it is
 * so. */
bool sender_has_room(const struct sender *sender, size_t bytes);

/* Connects and sends what can be done now; when there is work that cannot, waits for it up to
 * `timeout_ms`, then does it. False once the sender has given up. */
bool sender_poll(struct sender *sender, uint32_t timeout_ms);

/* Sends all that waits and lets the other side confirm it; true when that was done in time. */
bool sender_drain(struct sender *sender, uint32_t timeout_ms);

/* Closes; what still waits counts as dropped. */
void sender_close(struct sender *sender);

/* The last failure as one sentence, also while attempts go on; empty when there was none. */
const char *sender_sentence(const struct sender *sender);

#endif
