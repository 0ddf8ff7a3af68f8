/* The sender against a scripted network: every call can be made to fail, time is a number. */
#include "firmware/net/sender.h"

#include "unity.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

/* The fake network. */
static struct {
    int64_t now_ms;
    size_t addresses;             /* what the host resolves to */
    int connect_error;            /* returned at once by connect */
    int connected_status;         /* of a begun connection */
    int send_error;               /* 0: takes bytes */
    size_t send_room;             /* bytes that the kernel takes until told otherwise */
    size_t send_step;             /* bytes a call */
    int peer_status;
    int unconfirmed;
    int connects, closes, resolves, waits;
    int connect_families[16];
    int open_fds;
    uint8_t wire[65536];          /* what arrived on the present connection */
    size_t wire_bytes;
} net;

static size_t fake_resolve(const char *host, const char *port, struct sock_address *to,
                           const char **why)
{
    (void)host;
    (void)port;
    net.resolves++;
    for (size_t i = 0; i < net.addresses; i++) {
        memset(&to[i], 0, sizeof to[i]);
        to[i].storage.ss_family = (sa_family_t)(i + 1);
    }
    *why = "Name or service not known";
    return net.addresses;
}

static int fake_connect(const struct sock_address *address)
{
    net.connect_families[net.connects % 16] = address->storage.ss_family;
    net.connects++;
    if (net.connect_error != 0) {
        return -net.connect_error;
    }
    net.open_fds++;
    net.wire_bytes = 0;
    return 7;
}

static int fake_connected(int fd)
{
    TEST_ASSERT_EQUAL_INT(7, fd);
    return net.connected_status;
}

static ptrdiff_t fake_send(int fd, const uint8_t *bytes, size_t count)
{
    TEST_ASSERT_EQUAL_INT(7, fd);
    TEST_ASSERT_TRUE(count > 0);
    if (net.send_error != 0) {
        return -net.send_error;
    }
    size_t taken = count < net.send_step ? count : net.send_step;
    taken = taken < net.send_room ? taken : net.send_room;
    if (taken == 0) {
        return -EAGAIN;
    }
    TEST_ASSERT_TRUE(net.wire_bytes + taken <= sizeof net.wire);
    memcpy(net.wire + net.wire_bytes, bytes, taken);
    net.wire_bytes += taken;
    net.send_room -= taken;
    return (ptrdiff_t)taken;
}

static int fake_peer(int fd)
{
    TEST_ASSERT_EQUAL_INT(7, fd);
    return net.peer_status;
}

static int fake_unconfirmed(int fd)
{
    TEST_ASSERT_EQUAL_INT(7, fd);
    return net.unconfirmed;
}

static void fake_wait(int fd, uint32_t timeout_ms)
{
    (void)fd;
    TEST_ASSERT_TRUE(timeout_ms > 0);
    net.waits++;
    net.now_ms += timeout_ms;
}

static void fake_close(int fd)
{
    TEST_ASSERT_EQUAL_INT(7, fd);
    net.closes++;
    net.open_fds--;
}

static int64_t fake_now(void)
{
    return net.now_ms;
}

static const char *fake_text(int error)
{
    return error == ECONNREFUSED ? "Connection refused" : strerror(error);
}

static const struct sock_sys fake = {
    .resolve = fake_resolve, .connect = fake_connect, .connected = fake_connected,
    .send = fake_send, .peer = fake_peer, .unconfirmed = fake_unconfirmed, .wait = fake_wait,
    .close = fake_close, .now_ms = fake_now, .error_text = fake_text,
};

enum { PACKET_MAX = 100, RING = 100 };
static uint8_t memory[PACKET_MAX + RING];
static struct sender sender;

void setUp(void)
{
    memset(&net, 0, sizeof net);
    net.addresses = 1;
    net.send_room = sizeof net.wire;
    net.send_step = sizeof net.wire;
    net.now_ms = 1000;
}

void tearDown(void)
{
    if (sender.sys != NULL) {
        sender_close(&sender);
    }
    TEST_ASSERT_EQUAL_INT(0, net.open_fds);
}

static bool open_to(const char *to, uint32_t give_up_ms)
{
    const struct sender_options options = { .to = to, .give_up_ms = give_up_ms,
        .packet_bytes_max = PACKET_MAX, .memory = memory, .memory_bytes = sizeof memory };
    return sender_open(&sender, &fake, &options);
}

/* A packet of `bytes` bytes, each of them `name`. */
static void offer(uint8_t name, size_t bytes)
{
    uint8_t packet[PACKET_MAX + 1];
    memset(packet, name, sizeof packet);
    sender_offer(&sender, packet, bytes);
}

/* What arrived, as names with counts: "a10b20". */
static const char *arrived(void)
{
    static char text[256];
    size_t used = 0;
    text[0] = 0;
    for (size_t i = 0; i < net.wire_bytes;) {
        size_t run = 1;
        while (i + run < net.wire_bytes && net.wire[i + run] == net.wire[i]) {
            run++;
        }
        used += (size_t)snprintf(text + used, sizeof text - used, "%c%u", net.wire[i],
                                 (unsigned)run);
        i += run;
    }
    return text;
}

static void packets_arrive_whole_and_in_order_however_little_the_kernel_takes(void)
{
    for (size_t step = 1; step < 45; step++) {
        setUp();
        net.send_step = step;
        TEST_ASSERT_TRUE(open_to("rig:7400", 0));
        offer('a', 10);
        offer('b', 20);
        offer('c', 1);
        TEST_ASSERT_TRUE(sender_poll(&sender, 0));
        TEST_ASSERT_EQUAL_STRING("a10b20c1", arrived());
        TEST_ASSERT_EQUAL_UINT64(3, sender.counters.packets_sent);
        TEST_ASSERT_EQUAL_UINT64(31, sender.counters.bytes_sent);
        TEST_ASSERT_EQUAL_UINT64(0, sender.counters.packets_dropped);
        tearDown();
    }
}

/* The ring's 100 bytes are walked round at every phase. */
static void packets_stay_whole_where_the_ring_wraps(void)
{
    TEST_ASSERT_TRUE(open_to("rig:7400", 0));
    for (size_t i = 0; i < 1000; i++) {
        const size_t bytes = 1 + i * 7 % 96;
        net.wire_bytes = 0;
        net.send_room = 1000;
        offer((uint8_t)(i & 0xff), bytes);
        TEST_ASSERT_TRUE(sender_poll(&sender, 0));
        TEST_ASSERT_EQUAL_UINT(bytes, net.wire_bytes);
        for (size_t k = 0; k < bytes; k++) {
            TEST_ASSERT_EQUAL_UINT8(i & 0xff, net.wire[k]);
        }
    }
}

static void a_full_ring_drops_the_oldest_and_never_the_packet_under_way(void)
{
    TEST_ASSERT_TRUE(open_to("rig:7400", 0));
    net.send_room = 3;
    offer('a', 10);
    TEST_ASSERT_TRUE(sender_poll(&sender, 0));   /* a is under way, 3 bytes of it are gone */
    offer('b', 30);
    offer('c', 30);
    TEST_ASSERT_FALSE(sender_has_room(&sender, 29));
    TEST_ASSERT_TRUE(sender_has_room(&sender, 28));
    offer('d', 60);                              /* 34 + 34 + 64 > 100: b goes; 34 + 64 fit */
    TEST_ASSERT_EQUAL_UINT64(1, sender.counters.packets_dropped);
    net.send_room = 1000;
    TEST_ASSERT_TRUE(sender_poll(&sender, 0));
    TEST_ASSERT_EQUAL_STRING("a10c30d60", arrived());
}

static void a_packet_longer_than_the_memory_is_dropped_and_counted(void)
{
    TEST_ASSERT_TRUE(open_to("rig:7400", 0));
    offer('a', 97);                              /* 97 + 4 > 100 */
    offer('b', 101);
    TEST_ASSERT_FALSE(sender_has_room(&sender, 97));
    offer('c', 96);
    TEST_ASSERT_TRUE(sender_poll(&sender, 0));
    TEST_ASSERT_EQUAL_STRING("c96", arrived());
    TEST_ASSERT_EQUAL_UINT64(2, sender.counters.packets_dropped);
}

static void a_refused_connection_gives_up_in_time_with_a_sentence(void)
{
    net.connect_error = ECONNREFUSED;
    TEST_ASSERT_TRUE(open_to("rig:7400", 3000));
    int polls = 0;
    while (sender_poll(&sender, 100)) {
        polls++;
        TEST_ASSERT_TRUE(polls < 1000);
    }
    TEST_ASSERT_EQUAL_INT(1000 + 3000, (int)net.now_ms);
    TEST_ASSERT_NOT_NULL(strstr(sender_sentence(&sender), "rig:7400: Connection refused"));
    TEST_ASSERT_FALSE(sender_poll(&sender, 100));
    offer('a', 1);
    TEST_ASSERT_EQUAL_UINT64(1, sender.counters.packets_dropped);
    /* Waits of 100, 200, 400, 800 and 1600 ms lie between the attempts: at 0, 100, 300, 700,
     * 1500. */
    TEST_ASSERT_EQUAL_INT(5, net.connects);
    TEST_ASSERT_EQUAL_INT(1, net.resolves);
}

static void a_begun_connection_that_fails_is_closed_and_tried_again(void)
{
    net.connected_status = -ECONNREFUSED;
    TEST_ASSERT_TRUE(open_to("rig:7400", 0));
    TEST_ASSERT_EQUAL_INT(1, net.closes);
    TEST_ASSERT_EQUAL_INT(SENDER_WAITS, sender.state);
    net.connected_status = 0;
    offer('a', 5);
    TEST_ASSERT_TRUE(sender_poll(&sender, 99));
    TEST_ASSERT_EQUAL_INT(1, net.connects);
    TEST_ASSERT_TRUE(sender_poll(&sender, 1));
    TEST_ASSERT_EQUAL_INT(2, net.connects);
    TEST_ASSERT_EQUAL_STRING("a5", arrived());
    TEST_ASSERT_EQUAL_STRING("", sender_sentence(&sender));
}

static void an_address_that_does_not_answer_is_left_for_the_next_one(void)
{
    net.addresses = 2;
    net.connected_status = -EINPROGRESS;
    TEST_ASSERT_TRUE(open_to("rig:7400", 0));
    TEST_ASSERT_EQUAL_INT(1, net.connects);
    while (net.connects == 1) {
        TEST_ASSERT_TRUE(sender_poll(&sender, 500));
        TEST_ASSERT_TRUE(net.now_ms <= 1000 + SENDER_CONNECT_MS);
    }
    TEST_ASSERT_EQUAL_INT(1, net.connect_families[0]);
    TEST_ASSERT_EQUAL_INT(2, net.connect_families[1]);
    TEST_ASSERT_EQUAL_INT(1, net.closes);
    net.connected_status = 0;
    TEST_ASSERT_TRUE(sender_poll(&sender, 0));
    TEST_ASSERT_EQUAL_INT(SENDER_STANDS, sender.state);
}

static void an_unknown_host_is_looked_up_again_until_it_is_known(void)
{
    net.addresses = 0;
    TEST_ASSERT_TRUE(open_to("rig:7400", 0));
    TEST_ASSERT_NOT_NULL(strstr(sender_sentence(&sender), "Name or service not known"));
    net.addresses = 1;
    TEST_ASSERT_TRUE(sender_poll(&sender, 100));
    TEST_ASSERT_EQUAL_INT(2, net.resolves);
    TEST_ASSERT_EQUAL_INT(SENDER_STANDS, sender.state);
}

static void a_lost_connection_sends_the_packet_under_way_again_from_its_start(void)
{
    TEST_ASSERT_TRUE(open_to("rig:7400", 0));
    net.send_room = 13;
    offer('a', 10);
    offer('b', 10);
    offer('c', 10);
    TEST_ASSERT_TRUE(sender_poll(&sender, 0));
    TEST_ASSERT_EQUAL_STRING("a10b3", arrived());
    net.send_error = ECONNRESET;
    TEST_ASSERT_TRUE(sender_poll(&sender, 0));
    TEST_ASSERT_NOT_NULL(strstr(sender_sentence(&sender), "lost the connection to rig:7400"));
    TEST_ASSERT_EQUAL_INT(0, net.open_fds);
    net.send_error = 0;
    net.send_room = 1000;
    TEST_ASSERT_TRUE(sender_poll(&sender, 100));
    TEST_ASSERT_EQUAL_STRING("b10c10", arrived());
    TEST_ASSERT_EQUAL_UINT32(2, sender.counters.connections);
    TEST_ASSERT_EQUAL_UINT64(3, sender.counters.packets_sent);
    TEST_ASSERT_EQUAL_UINT64(0, sender.counters.packets_dropped);
}

static void a_receiver_that_closes_is_noticed_without_anything_to_send(void)
{
    TEST_ASSERT_TRUE(open_to("rig:7400", 0));
    TEST_ASSERT_EQUAL_INT(SENDER_STANDS, sender.state);
    net.peer_status = -EPIPE;
    TEST_ASSERT_TRUE(sender_poll(&sender, 0));
    TEST_ASSERT_EQUAL_INT(SENDER_WAITS, sender.state);
    TEST_ASSERT_NOT_NULL(strstr(sender_sentence(&sender), "the receiver closed it"));
}

static void giving_up_counts_from_the_loss_of_the_connection(void)
{
    TEST_ASSERT_TRUE(open_to("rig:7400", 500));
    net.now_ms += 10000;
    TEST_ASSERT_TRUE(sender_poll(&sender, 0));
    net.peer_status = -ECONNRESET;
    net.connect_error = ECONNREFUSED;
    TEST_ASSERT_TRUE(sender_poll(&sender, 0));
    const int64_t lost_ms = net.now_ms;
    while (sender_poll(&sender, 50)) {
        TEST_ASSERT_TRUE(net.now_ms < lost_ms + 500);
    }
    TEST_ASSERT_EQUAL_INT(500, (int)(net.now_ms - lost_ms));
}

static void draining_waits_until_the_other_side_has_confirmed(void)
{
    TEST_ASSERT_TRUE(open_to("rig:7400", 0));
    offer('a', 10);
    net.unconfirmed = 10;
    const int64_t start_ms = net.now_ms;
    TEST_ASSERT_FALSE(sender_drain(&sender, 200));
    TEST_ASSERT_EQUAL_INT(200, (int)(net.now_ms - start_ms));
    TEST_ASSERT_TRUE(sender_sentence(&sender)[0] != 0);
    net.unconfirmed = 0;
    TEST_ASSERT_TRUE(sender_drain(&sender, 200));
    TEST_ASSERT_EQUAL_STRING("a10", arrived());
}

static void draining_ends_in_time_when_nobody_takes_anything(void)
{
    TEST_ASSERT_TRUE(open_to("rig:7400", 0));
    net.send_room = 0;
    offer('a', 10);
    const int64_t start_ms = net.now_ms;
    TEST_ASSERT_FALSE(sender_drain(&sender, 700));
    TEST_ASSERT_EQUAL_INT(700, (int)(net.now_ms - start_ms));
    sender_close(&sender);
    TEST_ASSERT_EQUAL_UINT64(1, sender.counters.packets_dropped);
}

static void polling_does_not_wait_when_there_is_nothing_to_do(void)
{
    TEST_ASSERT_TRUE(open_to("rig:7400", 0));
    TEST_ASSERT_TRUE(sender_poll(&sender, 1000));
    TEST_ASSERT_EQUAL_INT(0, net.waits);
    TEST_ASSERT_TRUE(sender_poll(&sender, 0));
    TEST_ASSERT_EQUAL_INT(0, net.waits);
}

static void destinations_are_host_and_port(void)
{
    const char *const good[] = { "rig:1", "127.0.0.1:65535", "[::1]:7400", "[fe80::1%eth0]:7400" };
    const char *const hosts[] = { "rig", "127.0.0.1", "::1", "fe80::1%eth0" };
    for (size_t i = 0; i < 4; i++) {
        TEST_ASSERT_TRUE_MESSAGE(open_to(good[i], 0), good[i]);
        TEST_ASSERT_EQUAL_STRING(hosts[i], sender.host);
        sender_close(&sender);
    }
    const char *const bad[] = { "", "rig", "rig:", ":7400", "rig:0", "rig:65536", "rig:7x",
                                "::1:7400",
                                "rig:-1", "[]:1", "rig:123456" };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        TEST_ASSERT_FALSE_MESSAGE(open_to(bad[i], 0), bad[i]);
        TEST_ASSERT_NOT_NULL(strstr(sender_sentence(&sender), "is not HOST:PORT"));
        TEST_ASSERT_FALSE(sender_poll(&sender, 0));
    }
}

static void memory_without_a_queue_is_refused(void)
{
    const struct sender_options options = { .to = "rig:7400", .packet_bytes_max = sizeof memory,
        .memory = memory, .memory_bytes = sizeof memory };
    TEST_ASSERT_FALSE(sender_open(&sender, &fake, &options));
    TEST_ASSERT_TRUE(sender_sentence(&sender)[0] != 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(packets_arrive_whole_and_in_order_however_little_the_kernel_takes);
    RUN_TEST(packets_stay_whole_where_the_ring_wraps);
    RUN_TEST(a_full_ring_drops_the_oldest_and_never_the_packet_under_way);
    RUN_TEST(a_packet_longer_than_the_memory_is_dropped_and_counted);
    RUN_TEST(a_refused_connection_gives_up_in_time_with_a_sentence);
    RUN_TEST(a_begun_connection_that_fails_is_closed_and_tried_again);
    RUN_TEST(an_address_that_does_not_answer_is_left_for_the_next_one);
    RUN_TEST(an_unknown_host_is_looked_up_again_until_it_is_known);
    RUN_TEST(a_lost_connection_sends_the_packet_under_way_again_from_its_start);
    RUN_TEST(a_receiver_that_closes_is_noticed_without_anything_to_send);
    RUN_TEST(giving_up_counts_from_the_loss_of_the_connection);
    RUN_TEST(draining_waits_until_the_other_side_has_confirmed);
    RUN_TEST(draining_ends_in_time_when_nobody_takes_anything);
    RUN_TEST(polling_does_not_wait_when_there_is_nothing_to_do);
    RUN_TEST(destinations_are_host_and_port);
    RUN_TEST(memory_without_a_queue_is_refused);
    return UNITY_END();
}
