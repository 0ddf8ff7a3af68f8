/* The sender's real calls, over the loop-back interface; and the sender upon them. */
#include "firmware/net/sender.h"
#include "firmware/net/sock_sys.h"

#include "unity.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static const struct sock_sys *const sys = &sock_sys_linux;
static int listening = -1;
static char port_text[8];

/* Far above what the loop-back interface takes: only a hang reaches it. */
enum { WAIT_MS = 5000 };

void setUp(void)
{
    struct sockaddr_in at = { .sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK) };
    socklen_t bytes = sizeof at;
    listening = socket(AF_INET, SOCK_STREAM, 0);
    TEST_ASSERT_TRUE(listening >= 0);
    TEST_ASSERT_EQUAL_INT(0, bind(listening, (struct sockaddr *)&at, sizeof at));
    TEST_ASSERT_EQUAL_INT(0, listen(listening, 4));
    TEST_ASSERT_EQUAL_INT(0, getsockname(listening, (struct sockaddr *)&at, &bytes));
    snprintf(port_text, sizeof port_text, "%u", (unsigned)ntohs(at.sin_port));
}

void tearDown(void)
{
    if (listening >= 0) {
        close(listening);
    }
}

/* A connection that stands; the other end goes to `other`. */
static int connect_to_us(int *other)
{
    struct sock_address list[SOCK_SYS_ADDRESSES_MAX];
    const char *why = NULL;
    TEST_ASSERT_EQUAL_UINT(1, sys->resolve("127.0.0.1", port_text, list, &why));
    const int fd = sys->connect(&list[0]);
    TEST_ASSERT_TRUE(fd >= 0);
    *other = accept(listening, NULL, NULL);
    TEST_ASSERT_TRUE(*other >= 0);
    const int64_t end_ms = sys->now_ms() + WAIT_MS;
    while (sys->connected(fd) == -EINPROGRESS) {
        sys->wait(fd, 10);
        TEST_ASSERT_TRUE(sys->now_ms() < end_ms);
    }
    TEST_ASSERT_EQUAL_INT(0, sys->connected(fd));
    return fd;
}

static void what_is_sent_arrives_and_is_confirmed(void)
{
    int other = -1;
    const int fd = connect_to_us(&other);
    TEST_ASSERT_EQUAL_INT(5, (int)sys->send(fd, (const uint8_t *)"hello", 5));
    char got[8];
    TEST_ASSERT_EQUAL_INT(5, (int)read(other, got, sizeof got));
    TEST_ASSERT_EQUAL_INT(0, memcmp(got, "hello", 5));
    const int64_t end_ms = sys->now_ms() + WAIT_MS;
    while (sys->unconfirmed(fd) != 0) {
        TEST_ASSERT_TRUE(sys->now_ms() < end_ms);
    }
    sys->close(fd);
    close(other);
}

static void a_full_connection_takes_no_more_instead_of_blocking(void)
{
    static uint8_t bytes[1 << 16];
    int other = -1;
    const int fd = connect_to_us(&other);
    ptrdiff_t sent = 0;
    for (int i = 0; i < 10000 && sent >= 0; i++) {
        sent = sys->send(fd, bytes, sizeof bytes);
    }
    TEST_ASSERT_EQUAL_INT(-EAGAIN, (int)sent);
    TEST_ASSERT_TRUE(sys->unconfirmed(fd) > 0);
    sys->close(fd);
    close(other);
}

static void what_the_other_side_says_is_thrown_away_and_its_closing_is_seen(void)
{
    int other = -1;
    const int fd = connect_to_us(&other);
    TEST_ASSERT_EQUAL_INT(0, sys->peer(fd));
    TEST_ASSERT_EQUAL_INT(3, (int)write(other, "abc", 3));
    TEST_ASSERT_EQUAL_INT(0, sys->peer(fd));
    close(other);
    const int64_t end_ms = sys->now_ms() + WAIT_MS;
    while (sys->peer(fd) == 0) {
        TEST_ASSERT_TRUE(sys->now_ms() < end_ms);
    }
    TEST_ASSERT_EQUAL_INT(-EPIPE, sys->peer(fd));
    sys->close(fd);
}

static void writing_to_a_dead_connection_is_an_error_and_no_signal(void)
{
    int other = -1;
    const int fd = connect_to_us(&other);
    close(other);
    ptrdiff_t sent = 0;
    const int64_t end_ms = sys->now_ms() + WAIT_MS;
    while (sent >= 0 && sys->now_ms() < end_ms) {
        sent = sys->send(fd, (const uint8_t *)"x", 1);
    }
    TEST_ASSERT_TRUE(sent == -EPIPE || sent == -ECONNRESET);
    sys->close(fd);
}

static void an_unknown_name_has_a_reason(void)
{
    struct sock_address list[SOCK_SYS_ADDRESSES_MAX];
    const char *why = NULL;
    TEST_ASSERT_EQUAL_UINT(0, sys->resolve("no such host", "7400", list, &why));
    TEST_ASSERT_NOT_NULL(why);
    TEST_ASSERT_TRUE(strlen(why) > 0);
}

static bool open_sender(struct sender *sender, uint32_t give_up_ms)
{
    static uint8_t memory[4096];
    static char to[32];
    snprintf(to, sizeof to, "127.0.0.1:%s", port_text);
    const struct sender_options options = { .to = to, .give_up_ms = give_up_ms,
        .packet_bytes_max = 1024, .memory = memory, .memory_bytes = sizeof memory };
    return sender_open(sender, sys, &options);
}

static void the_sender_brings_its_packets_over(void)
{
    static struct sender sender;
    TEST_ASSERT_TRUE(open_sender(&sender, 0));
    sender_offer(&sender, (const uint8_t *)"packet", 6);
    TEST_ASSERT_TRUE(sender_drain(&sender, WAIT_MS));
    sender_close(&sender);
    const int other = accept(listening, NULL, NULL);
    char got[16];
    TEST_ASSERT_EQUAL_INT(6, (int)read(other, got, sizeof got));
    TEST_ASSERT_EQUAL_INT(0, memcmp(got, "packet", 6));
    TEST_ASSERT_EQUAL_INT(0, (int)read(other, got, sizeof got));
    close(other);
}

static void the_sender_gives_up_where_nobody_listens(void)
{
    static struct sender sender;
    close(listening);
    listening = -1;
    TEST_ASSERT_TRUE(open_sender(&sender, 300));
    const int64_t end_ms = sys->now_ms() + WAIT_MS;
    while (sender_poll(&sender, 50)) {
        TEST_ASSERT_TRUE(sys->now_ms() < end_ms);
    }
    TEST_ASSERT_NOT_NULL(strstr(sender_sentence(&sender), "Connection refused"));
    sender_close(&sender);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(what_is_sent_arrives_and_is_confirmed);
    RUN_TEST(a_full_connection_takes_no_more_instead_of_blocking);
    RUN_TEST(what_the_other_side_says_is_thrown_away_and_its_closing_is_seen);
    RUN_TEST(writing_to_a_dead_connection_is_an_error_and_no_signal);
    RUN_TEST(an_unknown_name_has_a_reason);
    RUN_TEST(the_sender_brings_its_packets_over);
    RUN_TEST(the_sender_gives_up_where_nobody_listens);
    return UNITY_END();
}
