/* CRC-32C against published vectors and against the naive form. */
#include "common/wire/crc32c.h"

#include "unity.h"

#include <string.h>

void setUp(void) {}
void tearDown(void) {}

static uint32_t naive(const uint8_t *bytes, size_t count)
{
    uint32_t crc = 0xffffffffu;
    for (size_t i = 0; i < count; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++) {
            crc = (crc >> 1) ^ ((crc & 1) != 0 ? 0x82F63B78u : 0);
        }
    }
    return ~crc;
}

static void the_check_value_of_the_catalogue_comes_out(void)
{
    TEST_ASSERT_EQUAL_HEX32(0xE3069283u, crc32c(0, (const uint8_t *)"123456789", 9));
}

/* RFC 3720, appendix B.4. */
static void the_vectors_of_iscsi_come_out(void)
{
    uint8_t bytes[32];
    memset(bytes, 0, sizeof bytes);
    TEST_ASSERT_EQUAL_HEX32(0x8A9136AAu, crc32c(0, bytes, sizeof bytes));
    memset(bytes, 0xff, sizeof bytes);
    TEST_ASSERT_EQUAL_HEX32(0x62A8AB43u, crc32c(0, bytes, sizeof bytes));
    for (uint8_t i = 0; i < sizeof bytes; i++) {
        bytes[i] = i;
    }
    TEST_ASSERT_EQUAL_HEX32(0x46DD794Eu, crc32c(0, bytes, sizeof bytes));
    for (uint8_t i = 0; i < sizeof bytes; i++) {
        bytes[i] = (uint8_t)(31 - i);
    }
    TEST_ASSERT_EQUAL_HEX32(0x113FDB5Cu, crc32c(0, bytes, sizeof bytes));
}

static void nothing_has_checksum_zero(void)
{
    TEST_ASSERT_EQUAL_HEX32(0, crc32c(0, NULL, 0));
}

static void every_byte_value_agrees_with_the_naive_form(void)
{
    for (uint32_t value = 0; value < 256; value++) {
        const uint8_t bytes[2] = { (uint8_t)value, (uint8_t)(255 - value) };
        TEST_ASSERT_EQUAL_HEX32(naive(bytes, 2), crc32c(0, bytes, 2));
    }
}

static void pieces_give_the_checksum_of_the_whole(void)
{
    const uint8_t *text = (const uint8_t *)"feature packets";
    const size_t count = strlen((const char *)text);
    for (size_t cut = 0; cut <= count; cut++) {
        TEST_ASSERT_EQUAL_HEX32(crc32c(0, text, count),
                                crc32c(crc32c(0, text, cut), text + cut, count - cut));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(the_check_value_of_the_catalogue_comes_out);
    RUN_TEST(the_vectors_of_iscsi_come_out);
    RUN_TEST(nothing_has_checksum_zero);
    RUN_TEST(every_byte_value_agrees_with_the_naive_form);
    RUN_TEST(pieces_give_the_checksum_of_the_whole);
    return UNITY_END();
}
