/* One connection, one packet under way, and a ring of whole packets behind it.
 *
 * The packet under way is copied out of the ring before its first byte goes out, so that the ring
 * holds only packets that may be dropped. In the ring a packet is its length, 4 bytes, and its
 * bytes; both may run over the ring's end. */
#include "firmware/net/sender.h"

#include <assert.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>

enum { LENGTH_BYTES = 4 };

/* The ring. */

static uint8_t *ring(const struct sender *s)
{
    return s->options.memory + s->options.packet_bytes_max;
}

static void ring_write(struct sender *s, const uint8_t *bytes, size_t count)
{
    assert(s->ring_used + count <= s->ring_bytes);
    const size_t at = (s->ring_first + s->ring_used) % s->ring_bytes;
    const size_t before_end = s->ring_bytes - at < count ? s->ring_bytes - at : count;
    memcpy(ring(s) + at, bytes, before_end);
    memcpy(ring(s), bytes + before_end, count - before_end);
    s->ring_used += count;
}

/* `to` null: only steps over the bytes. */
static void ring_read(struct sender *s, uint8_t *to, size_t count)
{
    assert(s->ring_used >= count);
    const size_t before_end =
        s->ring_bytes - s->ring_first < count ? s->ring_bytes - s->ring_first : count;
    if (to != NULL) {
        memcpy(to, ring(s) + s->ring_first, before_end);
        memcpy(to + before_end, ring(s), count - before_end);
    }
    s->ring_first = (s->ring_first + count) % s->ring_bytes;
    s->ring_used -= count;
}

/* Takes the oldest packet out; its length. */
static size_t ring_pop(struct sender *s, uint8_t *to)
{
    uint32_t bytes = 0;
    uint8_t length[LENGTH_BYTES];
    ring_read(s, length, sizeof length);
    memcpy(&bytes, length, sizeof bytes);
    ring_read(s, to, bytes);
    return bytes;
}

static void ring_push(struct sender *s, const uint8_t *packet, size_t count)
{
    const uint32_t bytes = (uint32_t)count;
    uint8_t length[LENGTH_BYTES];
    memcpy(length, &bytes, sizeof length);
    ring_write(s, length, sizeof length);
    ring_write(s, packet, count);
}

/* The connection. */

/* Splits "host:port" or "[v6]:port". */
static bool parse_to(struct sender *s, const char *to)
{
    const char *colon = to != NULL ? strrchr(to, ':') : NULL;
    if (colon == NULL) {
        return false;
    }
    const char *host = to;
    size_t host_bytes = (size_t)(colon - to);
    if (host_bytes >= 2 && to[0] == '[' && colon[-1] == ']') {
        host = to + 1;
        host_bytes -= 2;
    } else if (memchr(to, ':', host_bytes) != NULL) {
        return false;   /* an IPv6 address without brackets */
    }
    const size_t port_bytes = strlen(colon + 1);
    if (host_bytes == 0 || host_bytes >= sizeof s->host || port_bytes == 0 || port_bytes > 5) {
        return false;
    }
    uint32_t port = 0;
    for (const char *digit = colon + 1; *digit != 0; digit++) {
        if (*digit < '0' || *digit > '9') {
            return false;
        }
        port = 10 * port + (uint32_t)(*digit - '0');
    }
    memcpy(s->host, host, host_bytes);
    s->host[host_bytes] = 0;
    snprintf(s->port, sizeof s->port, "%s", colon + 1);
    return port >= 1 && port <= 65535;
}

static void retry_later(struct sender *s)
{
    s->state = SENDER_WAITS;
    s->address_index = 0;
    s->next_attempt_ms = s->sys->now_ms() + s->backoff_ms;
    s->backoff_ms = 2 * s->backoff_ms < SENDER_BACKOFF_MS_MAX ? 2 * s->backoff_ms
                                                              : SENDER_BACKOFF_MS_MAX;
}

static void say(struct sender *s, const char *what, const char *why)
{
    snprintf(s->sentence, sizeof s->sentence,
             "%s %s: %s; start the receiver there (tessera-rig receive) or name another HOST:PORT",
             what, s->options.to, why);
}

/* Begins a connection to the first address from the current one on that lets it begin. */
static void try_addresses(struct sender *s)
{
    while (s->address_index < s->address_count) {
        s->fd = s->sys->connect(&s->addresses[s->address_index]);
        if (s->fd >= 0) {
            s->state = SENDER_CONNECTS;
            s->attempt_ends_ms = s->sys->now_ms() + SENDER_CONNECT_MS;
            return;
        }
        say(s, "cannot connect to", s->sys->error_text(-s->fd));
        s->fd = -1;
        s->address_index++;
    }
    retry_later(s);
}

static void attempt_failed(struct sender *s, int error)
{
    say(s, "cannot connect to", s->sys->error_text(error));
    s->sys->close(s->fd);
    s->fd = -1;
    s->address_index++;
    try_addresses(s);
}

static void attempt(struct sender *s)
{
    if (s->address_count == 0) {
        const char *why = "no address";
        s->address_count = s->sys->resolve(s->host, s->port, s->addresses, &why);
        if (s->address_count == 0) {
            say(s, "cannot find the host of", why);
            retry_later(s);
            return;
        }
    }
    s->address_index = 0;
    try_addresses(s);
}

static void connection_lost(struct sender *s, int error)
{
    const char *why = error == EPIPE ? "the receiver closed it" : s->sys->error_text(error);
    say(s, "lost the connection to", why);
    s->sys->close(s->fd);
    s->fd = -1;
    s->under_way_sent = 0;
    s->apart_since_ms = s->sys->now_ms();
    retry_later(s);
}

static void look_at_attempt(struct sender *s)
{
    const int status = s->sys->connected(s->fd);
    if (status == 0) {
        s->state = SENDER_STANDS;
        s->counters.connections++;
        s->sentence[0] = 0;
    } else if (status != -EINPROGRESS) {
        attempt_failed(s, -status);
    } else if (s->sys->now_ms() >= s->attempt_ends_ms) {
        attempt_failed(s, ETIMEDOUT);
    }
}

/* Sends until the kernel takes no more or nothing is left. */
static void send_queued(struct sender *s)
{
    int status = s->sys->peer(s->fd);
    while (status == 0) {
        if (s->under_way_bytes == 0) {
            if (s->ring_used == 0) {
                return;
            }
            s->under_way_bytes = ring_pop(s, s->options.memory);
            s->under_way_sent = 0;
        }
        const ptrdiff_t sent = s->sys->send(s->fd, s->options.memory + s->under_way_sent,
                                            s->under_way_bytes - s->under_way_sent);
        if (sent == -EAGAIN) {
            return;
        }
        if (sent < 0) {
            status = (int)sent;
            break;
        }
        s->under_way_sent += (size_t)sent;
        if (s->under_way_sent == s->under_way_bytes) {
            s->counters.packets_sent++;
            s->counters.bytes_sent += s->under_way_bytes;
            s->under_way_bytes = 0;
            s->backoff_ms = SENDER_BACKOFF_MS_MIN;   /* the connection is of use */
        }
    }
    connection_lost(s, -status);
}

/* One look at everything, without waiting. */
static void step(struct sender *s)
{
    if (s->state == SENDER_WAITS && s->sys->now_ms() >= s->next_attempt_ms) {
        attempt(s);
    }
    if (s->state == SENDER_CONNECTS) {
        look_at_attempt(s);
    }
    if (s->state == SENDER_STANDS) {
        send_queued(s);
    }
    const bool is_apart = s->state == SENDER_WAITS || s->state == SENDER_CONNECTS;
    if (is_apart && s->options.give_up_ms > 0 &&
        s->sys->now_ms() - s->apart_since_ms >= (int64_t)s->options.give_up_ms) {
        if (s->sentence[0] == 0) {
            say(s, "cannot connect to", s->sys->error_text(ETIMEDOUT));
        }
        if (s->fd >= 0) {
            s->sys->close(s->fd);
            s->fd = -1;
        }
        s->state = SENDER_GAVE_UP;
    }
}

static bool has_unsent(const struct sender *s)
{
    return s->under_way_bytes > 0 || s->ring_used > 0;
}

static int64_t earlier(int64_t a_ms, int64_t b_ms)
{
    return a_ms < b_ms ? a_ms : b_ms;
}

/* Waits for what the state waits for, at most until `until_ms`. */
static void wait_until(struct sender *s, int64_t until_ms)
{
    if (s->state != SENDER_STANDS && s->options.give_up_ms > 0) {
        until_ms = earlier(until_ms, s->apart_since_ms + (int64_t)s->options.give_up_ms);
    }
    if (s->state == SENDER_WAITS) {
        until_ms = earlier(until_ms, s->next_attempt_ms);
    } else if (s->state == SENDER_CONNECTS) {
        until_ms = earlier(until_ms, s->attempt_ends_ms);
    }
    const int64_t left_ms = until_ms - s->sys->now_ms();
    if (left_ms > 0) {
        s->sys->wait(s->fd, left_ms < 1000 ? (uint32_t)left_ms : 1000u);
    }
}

bool sender_open(struct sender *sender, const struct sock_sys *sys,
                 const struct sender_options *options)
{
    assert(sender != NULL && sys != NULL && options != NULL);
    memset(sender, 0, sizeof *sender);
    sender->sys = sys;
    sender->options = *options;
    sender->fd = -1;
    sender->state = SENDER_GAVE_UP;
    if (!parse_to(sender, options->to)) {
        snprintf(sender->sentence, sizeof sender->sentence,
                 "\"%s\" is not HOST:PORT; write for example 192.168.0.7:7400, rig.local:7400 or "
                 "[fd00::7]:7400", options->to != NULL ? options->to : "");
        return false;
    }
    if (options->memory == NULL || options->packet_bytes_max == 0 ||
        options->memory_bytes < options->packet_bytes_max + LENGTH_BYTES + 1) {
        snprintf(sender->sentence, sizeof sender->sentence,
                 "the sender's memory (%zu bytes) holds no packet of %zu bytes and a queue",
                 options->memory_bytes, options->packet_bytes_max);
        return false;
    }
    sender->ring_bytes = options->memory_bytes - options->packet_bytes_max;
    sender->backoff_ms = SENDER_BACKOFF_MS_MIN;
    sender->apart_since_ms = sys->now_ms();
    sender->next_attempt_ms = sender->apart_since_ms;
    sender->state = SENDER_WAITS;
    step(sender);
    return true;
}

void sender_offer(struct sender *sender, const uint8_t *packet, size_t bytes)
{
    assert(packet != NULL && bytes > 0);
    if (sender->state == SENDER_GAVE_UP || bytes > sender->options.packet_bytes_max ||
        bytes + LENGTH_BYTES > sender->ring_bytes) {
        sender->counters.packets_dropped++;
        return;
    }
    while (sender->ring_bytes - sender->ring_used < bytes + LENGTH_BYTES) {
        (void)ring_pop(sender, NULL);
        sender->counters.packets_dropped++;
    }
    ring_push(sender, packet, bytes);
}

bool sender_has_room(const struct sender *sender, size_t bytes)
{
    return bytes <= sender->options.packet_bytes_max &&
           sender->ring_bytes - sender->ring_used >= bytes + LENGTH_BYTES;
}

bool sender_poll(struct sender *sender, uint32_t timeout_ms)
{
    if (sender->state == SENDER_GAVE_UP) {
        return false;
    }
    step(sender);
    const bool has_work = sender->state != SENDER_STANDS || has_unsent(sender);
    if (timeout_ms > 0 && has_work && sender->state != SENDER_GAVE_UP) {
        wait_until(sender, sender->sys->now_ms() + timeout_ms);
        step(sender);
    }
    return sender->state != SENDER_GAVE_UP;
}

bool sender_drain(struct sender *sender, uint32_t timeout_ms)
{
    const int64_t end_ms = sender->sys->now_ms() + timeout_ms;
    bool done = false;
    while (!done) {
        const bool in_time = sender->sys->now_ms() < end_ms;
        if (!sender_poll(sender, 0)) {
            return false;
        }
        done = sender->state == SENDER_STANDS && !has_unsent(sender) &&
               sender->sys->unconfirmed(sender->fd) <= 0 && sender->sys->peer(sender->fd) == 0;
        if (!done && !in_time) {
            if (sender->sentence[0] == 0) {
                snprintf(sender->sentence, sizeof sender->sentence,
                         "%s did not take everything in time: packets at the end are missing there",
                         sender->options.to);
            }
            return false;
        }
        if (!done && sender->state == SENDER_STANDS && !has_unsent(sender)) {
            sender->sys->wait(-1, 1);   /* nothing tells when the other side confirms */
        } else if (!done) {
            wait_until(sender, end_ms);
        }
    }
    return true;
}

void sender_close(struct sender *sender)
{
    if (sender->under_way_bytes > 0) {
        sender->under_way_bytes = 0;
        sender->counters.packets_dropped++;
    }
    while (sender->ring_used > 0) {
        (void)ring_pop(sender, NULL);
        sender->counters.packets_dropped++;
    }
    if (sender->fd >= 0) {
        sender->sys->close(sender->fd);
        sender->fd = -1;
    }
    sender->state = SENDER_GAVE_UP;
}

const char *sender_sentence(const struct sender *sender)
{
    return sender->sentence;
}
