/* Packets against the golden samples of tests/golden/wire, which were made from WIRE.md without
 * this code; boundaries; refusals; what the encoder leaves out. */
#include "common/wire/wire.h"

#include "unity.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define GOLDEN "tests/golden/wire/"

static uint8_t packet[WIRE_PACKET_BYTES_MAX + 1];
static struct wire_packet_view view;
static struct wire_writer writer;

void setUp(void) {}
void tearDown(void) {}

/* Bytes of a golden sample; the word behind its '#' goes to `status`. */
static size_t read_golden(const char *name, uint8_t *to, size_t capacity, char status[64])
{
    char path[512];
    char line[256];
    size_t count = 0;
    snprintf(path, sizeof path, GOLDEN "%s", name);
    FILE *file = fopen(path, "r");
    TEST_ASSERT_NOT_NULL_MESSAGE(file, path);
    while (fgets(line, sizeof line, file) != NULL) {
        if (line[0] == '#') {
            TEST_ASSERT_EQUAL_INT(1, sscanf(line, "# %63s", status));
            continue;
        }
        unsigned byte;
        int used;
        for (const char *at = line; sscanf(at, "%2x%n", &byte, &used) == 1; at += used) {
            TEST_ASSERT_TRUE(count < capacity);
            to[count++] = (uint8_t)byte;
        }
    }
    fclose(file);
    return count;
}

static void expect_golden(const char *name, const uint8_t *bytes, size_t count)
{
    static uint8_t golden[4096];
    char status[64] = "";
    const size_t golden_count = read_golden(name, golden, sizeof golden, status);
    TEST_ASSERT_EQUAL_UINT(golden_count, count);
    for (size_t i = 0; i < count; i++) {
        char where[64];
        snprintf(where, sizeof where, "%s, byte %u", name, (unsigned)i);
        TEST_ASSERT_EQUAL_HEX8_MESSAGE(golden[i], bytes[i], where);
    }
}

static const struct wire_header full = {
    .camera_serial = "kam\xc3\xa9ra-7",
    .boot_id = 0x1112131415161718u,
    .sequence = 0x21222324u,
    .packet_index = 0x31323334u,
    .t_capture_ns = 0x4142434445464748,
    .clock_uncertainty_ns = 0x51525354u,
    .exposure_ns = 0x61626364u,
    .row_time_ns = 0x71727374u,
    .clock_kind = WIRE_CLOCK_TAI,
    .flips = WIRE_FLIP_ROWS,
    .binning_x = 1,
    .binning_y = 2,
    .width_px = 1920,
    .height_px = 1080,
    .region_x = 0x0102,
    .region_y = 0x0304,
    .region_width = 0x0782,
    .region_height = 0x0874,
    .frames_dropped = 0x81828384u,
    .target_digest = 0x9192939495969798u,
    .settings_digest = 0xa1a2a3a4a5a6a7a8u,
    .packets_dropped = 0xb1b2b3b4u,
    .truncated = WIRE_TRUNCATED_EDGES | WIRE_TRUNCATED_MARKS,
};

static struct wire_feature feature(uint8_t index, int32_t x_px_q16, int32_t y_px_q16)
{
    return (struct wire_feature){ .index = index, .x_px_q16 = x_px_q16, .y_px_q16 = y_px_q16,
                                  .sigma_px_q24 = 1u << 14, .size_px_q16 = 8u << 16 };
}

static size_t write_full(uint8_t *to, size_t capacity)
{
    /* 2^(13/3 - 11) px = 0.00984 px; 2^(12/3) = 16 px; then both ends of the codes; 2^(10/3 -
     * 11), 8 px. */
    const struct wire_feature first[] = {
        { .index = 0, .x_px_q16 = 62865408, .y_px_q16 = 35364864, .sigma_px_q24 = 165140,
          .size_px_q16 = 16u << 16 },
        { .index = 3, .x_px_q16 = 32768, .y_px_q16 = 0, .sigma_px_q24 = 0, .size_px_q16 = 0 },
        { .index = 12, .x_px_q16 = (1919 << 16) + 32767, .y_px_q16 = (1079 << 16) + 32767,
          .sigma_px_q24 = UINT32_MAX, .size_px_q16 = UINT32_MAX },
    };
    const struct wire_feature second[] = {
        { .index = 1, .x_px_q16 = -32768, .y_px_q16 = -32768, .sigma_px_q24 = 82570,
          .size_px_q16 = 8u << 16 },
    };
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_begin(&writer, to, capacity, &full));
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_put_patch(&writer, 5, first, 3));
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_put_patch(&writer, 0x0abc, second, 1));
    return wire_finish(&writer);
}

static void every_byte_of_a_full_packet_is_the_golden_one(void)
{
    memset(packet, 0x5a, sizeof packet);
    expect_golden("good_full.hex", packet, write_full(packet, sizeof packet));
}

static void the_smallest_packet_is_the_golden_one(void)
{
    const struct wire_header header = { .camera_serial = "c", .width_px = 1, .height_px = 1 };
    memset(packet, 0x5a, sizeof packet);
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_begin(&writer, packet, WIRE_HEADER_BYTES, &header));
    expect_golden("good_empty.hex", packet, wire_finish(&writer));
}

static void extremes_of_every_field_are_the_golden_ones(void)
{
    struct wire_header header = {
        .camera_serial = "0123456789abcdef0123456789abcdef", .boot_id = UINT64_MAX,
        .sequence = UINT32_MAX, .packet_index = UINT32_MAX, .t_capture_ns = INT64_MIN,
        .clock_uncertainty_ns = WIRE_CLOCK_UNCERTAINTY_UNKNOWN, .exposure_ns = UINT32_MAX,
        .row_time_ns = UINT32_MAX, .clock_kind = WIRE_CLOCK_FILE, .flips = 3, .binning_x = 16,
        .binning_y = 1, .width_px = 4095, .height_px = 32768, .region_x = 65535, .region_y = 65535,
        .region_width = 65520, .region_height = 32768, .frames_dropped = UINT32_MAX,
        .target_digest = UINT64_MAX, .settings_digest = UINT64_MAX, .packets_dropped = UINT32_MAX,
        .truncated = 0xffff & ~WIRE_TRUNCATED_PACKET,
    };
    const struct wire_feature last = { .index = 0, .x_px_q16 = (4094 << 16) + 32767,
        .y_px_q16 = (32767 << 16) + 32767, .sigma_px_q24 = UINT32_MAX, .size_px_q16 = UINT32_MAX };
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_begin(&writer, packet, sizeof packet, &header));
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_put_patch(&writer, 4095, &last, 1));
    /* A patch that no longer fits sets the last truncation flag. */
    writer.capacity = writer.used;
    writer.last_patch_id = 4094;
    TEST_ASSERT_EQUAL_INT(WIRE_FULL, wire_put_patch(&writer, 4095, &last, 1));
    expect_golden("good_extreme.hex", packet, wire_finish(&writer));
}

static void level_3_patches_are_the_golden_ones(void)
{
    static struct wire_feature all[WIRE_FEATURES];
    const uint32_t codes_sigma[3] = { 8192, 10321, 13004 };     /* 2^(k/3 - 11) px in 24 bits */
    const uint32_t codes_size[3] = { 65536, 82570, 104032 };    /* 2^(k/3) px in 16 bits */
    for (uint8_t i = 0; i < WIRE_FEATURES; i++) {
        const uint32_t sigma = i % 32u;
        const uint32_t size = (3u * i) % 32u;
        all[i] = (struct wire_feature){ .index = i, .x_px_q16 = (1000 * i + 500) * 16 - 32768,
            .y_px_q16 = (700 * i + 300) * 16 - 32768,
            .sigma_px_q24 = codes_sigma[sigma % 3] << (sigma / 3),
            .size_px_q16 = codes_size[size % 3] << (size / 3) };
    }
    struct wire_feature two[2] = { all[12], all[13] };
    two[0].x_px_q16 = 1 * 16 - 32768;
    two[0].y_px_q16 = 2 * 16 - 32768;
    two[0].sigma_px_q24 = 8192u << 1;
    two[0].size_px_q16 = 82570u << 1;
    two[1].x_px_q16 = 5 * 16 - 32768;
    two[1].y_px_q16 = 6 * 16 - 32768;
    two[1].sigma_px_q24 = 10321u << 2;
    two[1].size_px_q16 = 104032u << 2;
    struct wire_feature one = all[84];
    one.x_px_q16 = 9 * 16 - 32768;
    one.y_px_q16 = 10 * 16 - 32768;
    one.sigma_px_q24 = 13004u << 3;
    one.size_px_q16 = 65536u << 4;
    struct wire_header header = full;
    header.truncated = 0;
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_begin(&writer, packet, sizeof packet, &header));
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_put_patch(&writer, 0, all, WIRE_FEATURES));
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_put_patch(&writer, 7, two, 2));
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_put_patch(&writer, 4095, &one, 1));
    expect_golden("good_level3.hex", packet, wire_finish(&writer));
}

static void what_was_written_is_read_again(void)
{
    const size_t count = write_full(packet, sizeof packet);
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_decode(packet, count, &view));
    struct wire_header expected = full;
    expected.patch_count = 2;
    expected.feature_count = 4;
    expected.fraction_bits = 12;
    const struct wire_header *h = &view.header;
    TEST_ASSERT_EQUAL_STRING(expected.camera_serial, h->camera_serial);
    TEST_ASSERT_EQUAL_HEX64(expected.boot_id, h->boot_id);
    TEST_ASSERT_EQUAL_HEX32(expected.sequence, h->sequence);
    TEST_ASSERT_EQUAL_HEX32(expected.packet_index, h->packet_index);
    TEST_ASSERT_EQUAL_INT64(expected.t_capture_ns, h->t_capture_ns);
    TEST_ASSERT_EQUAL_HEX32(expected.clock_uncertainty_ns, h->clock_uncertainty_ns);
    TEST_ASSERT_EQUAL_HEX32(expected.exposure_ns, h->exposure_ns);
    TEST_ASSERT_EQUAL_HEX32(expected.row_time_ns, h->row_time_ns);
    TEST_ASSERT_EQUAL_UINT8(expected.clock_kind, h->clock_kind);
    TEST_ASSERT_EQUAL_UINT8(expected.flips, h->flips);
    TEST_ASSERT_EQUAL_UINT8(expected.binning_x, h->binning_x);
    TEST_ASSERT_EQUAL_UINT8(expected.binning_y, h->binning_y);
    TEST_ASSERT_EQUAL_UINT16(expected.width_px, h->width_px);
    TEST_ASSERT_EQUAL_UINT16(expected.height_px, h->height_px);
    TEST_ASSERT_EQUAL_UINT16(expected.region_x, h->region_x);
    TEST_ASSERT_EQUAL_UINT16(expected.region_y, h->region_y);
    TEST_ASSERT_EQUAL_UINT16(expected.region_width, h->region_width);
    TEST_ASSERT_EQUAL_UINT16(expected.region_height, h->region_height);
    TEST_ASSERT_EQUAL_HEX32(expected.frames_dropped, h->frames_dropped);
    TEST_ASSERT_EQUAL_HEX64(expected.target_digest, h->target_digest);
    TEST_ASSERT_EQUAL_HEX64(expected.settings_digest, h->settings_digest);
    TEST_ASSERT_EQUAL_HEX32(expected.packets_dropped, h->packets_dropped);
    TEST_ASSERT_EQUAL_HEX16(expected.truncated, h->truncated);
    TEST_ASSERT_EQUAL_UINT16(expected.patch_count, h->patch_count);
    TEST_ASSERT_EQUAL_UINT32(expected.feature_count, h->feature_count);
    TEST_ASSERT_EQUAL_UINT8(expected.fraction_bits, h->fraction_bits);

    struct wire_patch_cursor at = wire_patches(&view);
    struct wire_feature f;
    TEST_ASSERT_FALSE(wire_next_feature(&at, &f));
    TEST_ASSERT_TRUE(wire_next_patch(&at));
    TEST_ASSERT_EQUAL_UINT16(5, at.patch_id);
    TEST_ASSERT_EQUAL_UINT8(3, at.feature_count);
    TEST_ASSERT_TRUE(wire_next_feature(&at, &f));
    TEST_ASSERT_EQUAL_UINT8(0, f.index);
    TEST_ASSERT_EQUAL_INT32(62865408, f.x_px_q16);          /* 959.25 px */
    TEST_ASSERT_EQUAL_INT32(35364864, f.y_px_q16);          /* 539.625 px */
    TEST_ASSERT_EQUAL_UINT32(165140, f.sigma_px_q24);       /* 2^(13/3 - 11) px */
    TEST_ASSERT_EQUAL_UINT32(16u << 16, f.size_px_q16);
    TEST_ASSERT_TRUE(wire_next_feature(&at, &f));
    TEST_ASSERT_EQUAL_UINT8(3, f.index);
    TEST_ASSERT_TRUE(wire_next_feature(&at, &f));
    TEST_ASSERT_EQUAL_UINT8(12, f.index);
    TEST_ASSERT_FALSE(wire_next_feature(&at, &f));
    TEST_ASSERT_TRUE(wire_next_patch(&at));
    TEST_ASSERT_EQUAL_UINT16(0x0abc, at.patch_id);
    TEST_ASSERT_TRUE(wire_next_feature(&at, &f));
    TEST_ASSERT_EQUAL_INT32(-32768, f.x_px_q16);
    TEST_ASSERT_EQUAL_INT32(-32768, f.y_px_q16);
    TEST_ASSERT_FALSE(wire_next_feature(&at, &f));
    TEST_ASSERT_FALSE(wire_next_patch(&at));
    TEST_ASSERT_FALSE(wire_next_patch(&at));
}

/* Features may be left unread. */
static void walking_over_patches_alone_finds_them_all(void)
{
    char status[64];
    const size_t count = read_golden("good_level3.hex", packet, sizeof packet, status);
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_decode(packet, count, &view));
    struct wire_patch_cursor at = wire_patches(&view);
    const uint16_t ids[] = { 0, 7, 4095 };
    const uint8_t counts[] = { 85, 2, 1 };
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_TRUE(wire_next_patch(&at));
        TEST_ASSERT_EQUAL_UINT16(ids[i], at.patch_id);
        TEST_ASSERT_EQUAL_UINT8(counts[i], at.feature_count);
    }
    TEST_ASSERT_FALSE(wire_next_patch(&at));
}

static void a_longer_header_is_skipped_and_ignore_bits_are_ignored(void)
{
    char status[64];
    const size_t count = read_golden("good_longer_header.hex", packet, sizeof packet, status);
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_decode(packet, count, &view));
    struct wire_patch_cursor at = wire_patches(&view);
    struct wire_feature f;
    TEST_ASSERT_TRUE(wire_next_patch(&at));
    TEST_ASSERT_EQUAL_UINT16(9, at.patch_id);
    TEST_ASSERT_TRUE(wire_next_feature(&at, &f));
    TEST_ASSERT_EQUAL_INT32(65536 / 512 - 32768, f.x_px_q16);   /* one step of 2^-9 px */
}

/* The name of a status as the samples write it. */
static const char *name_of(enum wire_status status)
{
    static const char *const names[WIRE_STATUS_COUNT] = {
        "WIRE_OK", "WIRE_SHORT", "WIRE_BAD_MAGIC", "WIRE_BAD_VERSION", "WIRE_BAD_LENGTH",
        "WIRE_BAD_CHECKSUM", "WIRE_RESERVED_SET", "WIRE_BAD_SERIAL", "WIRE_BAD_CLOCK",
        "WIRE_BAD_IMAGE", "WIRE_BAD_SENSOR", "WIRE_BAD_ORDER", "WIRE_EMPTY_PATCH",
        "WIRE_OUTSIDE_IMAGE", "WIRE_BAD_COUNT", "WIRE_FULL",
    };
    return names[status];
}

static void every_sample_has_the_status_that_it_names(void)
{
    DIR *folder = opendir(GOLDEN);
    TEST_ASSERT_NOT_NULL(folder);
    bool seen[WIRE_STATUS_COUNT] = { false };
    const struct dirent *entry;
    while ((entry = readdir(folder)) != NULL) {
        const char *dot = strrchr(entry->d_name, '.');
        if (dot == NULL || strcmp(dot, ".hex") != 0) {
            continue;
        }
        char status[64] = "";
        const size_t count = read_golden(entry->d_name, packet, sizeof packet, status);
        /* A copy of just the size, so that the sanitizers see any read beyond it. */
        uint8_t *exact = malloc(count > 0 ? count : 1);
        TEST_ASSERT_NOT_NULL(exact);
        memcpy(exact, packet, count);
        const enum wire_status found = wire_decode(exact, count, &view);
        free(exact);
        TEST_ASSERT_EQUAL_STRING_MESSAGE(status, name_of(found), entry->d_name);
        seen[found] = true;
    }
    closedir(folder);
    for (int i = 0; i < WIRE_FULL; i++) {
        TEST_ASSERT_TRUE_MESSAGE(seen[i], name_of((enum wire_status)i));
    }
}

static void every_cut_and_every_turned_bit_is_refused(void)
{
    const size_t count = write_full(packet, sizeof packet);
    for (size_t cut = 0; cut < count; cut++) {
        TEST_ASSERT_EQUAL_INT(WIRE_SHORT, wire_decode(packet, cut, &view));
    }
    TEST_ASSERT_EQUAL_INT(WIRE_SHORT, wire_decode(NULL, 0, &view)); /* an empty vector's data */
    for (size_t bit = 0; bit < 8 * count; bit++) {
        packet[bit / 8] = (uint8_t)(packet[bit / 8] ^ (1u << (bit % 8)));
        TEST_ASSERT_NOT_EQUAL(WIRE_OK, wire_decode(packet, count, &view));
        packet[bit / 8] = (uint8_t)(packet[bit / 8] ^ (1u << (bit % 8)));
    }
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_decode(packet, count, &view));
}

static void a_full_packet_says_so_keeps_what_it_had_and_takes_no_more(void)
{
    const struct wire_feature three[] = { feature(0, 0, 0), feature(1, 0, 0), feature(2, 0, 0) };
    /* Room for the first patch of 4 + 7 bytes and all but one byte of the second of 4 + 21. */
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_begin(&writer, packet, WIRE_HEADER_BYTES + 11 + 24, &full));
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_put_patch(&writer, 1, three, 1));
    TEST_ASSERT_EQUAL_INT(WIRE_FULL, wire_put_patch(&writer, 2, three, 3));
    TEST_ASSERT_EQUAL_INT(WIRE_FULL, wire_put_patch(&writer, 3, three, 1));
    const size_t count = wire_finish(&writer);
    TEST_ASSERT_EQUAL_UINT(WIRE_HEADER_BYTES + 11, count);
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_decode(packet, count, &view));
    TEST_ASSERT_EQUAL_UINT16(1, view.header.patch_count);
    TEST_ASSERT_EQUAL_UINT32(1, view.header.feature_count);
    TEST_ASSERT_EQUAL_HEX16(full.truncated | WIRE_TRUNCATED_PACKET, view.header.truncated);
}

static void an_exact_fit_is_not_truncated(void)
{
    const struct wire_feature three[] = { feature(0, 0, 0), feature(1, 0, 0), feature(2, 0, 0) };
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_begin(&writer, packet, WIRE_HEADER_BYTES + 25, &full));
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_put_patch(&writer, 2, three, 3));
    TEST_ASSERT_EQUAL_UINT(WIRE_HEADER_BYTES + 25, wire_finish(&writer));
    TEST_ASSERT_EQUAL_HEX16(full.truncated, writer.truncated);
}

static void no_room_for_the_header_gives_no_packet(void)
{
    TEST_ASSERT_EQUAL_INT(WIRE_FULL, wire_begin(&writer, packet, WIRE_HEADER_BYTES - 1, &full));
    TEST_ASSERT_EQUAL_UINT(0, wire_finish(&writer));
}

static void the_encoder_refuses_what_the_decoder_would(void)
{
    struct wire_header h = full;
    memset(h.camera_serial, 0, sizeof h.camera_serial);
    TEST_ASSERT_EQUAL_INT(WIRE_BAD_SERIAL, wire_begin(&writer, packet, sizeof packet, &h));
    TEST_ASSERT_EQUAL_UINT(0, wire_finish(&writer));
    memset(h.camera_serial, 'a', sizeof h.camera_serial);
    TEST_ASSERT_EQUAL_INT(WIRE_BAD_SERIAL, wire_begin(&writer, packet, sizeof packet, &h));
    h = full;
    h.clock_kind = WIRE_CLOCK_COUNT;
    TEST_ASSERT_EQUAL_INT(WIRE_BAD_CLOCK, wire_begin(&writer, packet, sizeof packet, &h));
    h = full;
    h.width_px = 0;
    TEST_ASSERT_EQUAL_INT(WIRE_BAD_IMAGE, wire_begin(&writer, packet, sizeof packet, &h));
    h = full;
    h.region_width = 1919;
    TEST_ASSERT_EQUAL_INT(WIRE_BAD_SENSOR, wire_begin(&writer, packet, sizeof packet, &h));
}

static void a_refused_patch_leaves_the_packet_as_it_was(void)
{
    const struct wire_feature good[] = { feature(4, 0, 0), feature(84, 0, 0) };
    struct wire_feature bad[] = { feature(4, 0, 0), feature(4, 0, 0) };
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_begin(&writer, packet, sizeof packet, &full));
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_put_patch(&writer, 5, good, 2));
    const size_t used = writer.used;
    TEST_ASSERT_EQUAL_INT(WIRE_BAD_ORDER, wire_put_patch(&writer, 6, bad, 2));
    bad[1] = feature(85, 0, 0);
    TEST_ASSERT_EQUAL_INT(WIRE_BAD_ORDER, wire_put_patch(&writer, 6, bad, 2));
    TEST_ASSERT_EQUAL_INT(WIRE_BAD_ORDER, wire_put_patch(&writer, 5, good, 2));
    TEST_ASSERT_EQUAL_INT(WIRE_BAD_ORDER, wire_put_patch(&writer, 4096, good, 2));
    TEST_ASSERT_EQUAL_INT(WIRE_EMPTY_PATCH, wire_put_patch(&writer, 6, good, 0));
    const int32_t right_q16 = (1919 << 16) + 32768;
    const int32_t below_q16 = (1079 << 16) + 32768;
    const struct wire_feature outside[] = { feature(0, -32769, 0), feature(0, 0, -32769),
                                            feature(0, right_q16, 0), feature(0, 0, below_q16),
                                            feature(0, INT32_MIN, 0), feature(0, INT32_MAX, 0) };
    for (size_t i = 0; i < sizeof outside / sizeof outside[0]; i++) {
        TEST_ASSERT_EQUAL_INT(WIRE_OUTSIDE_IMAGE, wire_put_patch(&writer, 6, &outside[i], 1));
    }
    TEST_ASSERT_EQUAL_UINT(used, writer.used);
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_decode(packet, wire_finish(&writer), &view));
    TEST_ASSERT_EQUAL_UINT32(2, view.header.feature_count);
}

/* Half a step is the worst that rounding may do; the step is 2^-12 px = 16 / 65536 at 1920x1080.
 * Only in the last half step before the far corner it may be a whole one. */
static void positions_come_back_within_half_a_step(void)
{
    for (int32_t x = -32768; x < 32768 + 4000; x += 7) {
        const struct wire_feature in = feature(0, x, (1079 << 16) + 32767 - (x + 32768));
        struct wire_feature out;
        TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_begin(&writer, packet, sizeof packet, &full));
        TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_put_patch(&writer, 0, &in, 1));
        TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_decode(packet, wire_finish(&writer), &view));
        struct wire_patch_cursor at = wire_patches(&view);
        TEST_ASSERT_TRUE(wire_next_patch(&at) && wire_next_feature(&at, &out));
        TEST_ASSERT_INT_WITHIN(8, in.x_px_q16, out.x_px_q16);
        TEST_ASSERT_INT_WITHIN(x < -32768 + 8 ? 16 : 8, in.y_px_q16, out.y_px_q16);
    }
}

static void fraction_bits_are_the_most_that_fit(void)
{
    const uint32_t sides[] = { 1, 512, 513, 1024, 1025, 1920, 2048,
                               2049, 4096, 4097, 8192, 16384, 32768 };
    const uint8_t bits[] = { 14, 14, 13, 13, 12, 12, 12, 11, 11, 10, 10, 9, 8 };
    for (size_t i = 0; i < sizeof sides / sizeof sides[0]; i++) {
        TEST_ASSERT_EQUAL_UINT8(bits[i], wire_fraction_bits(sides[i]));
    }
}

static void a_prefix_tells_the_length_only_within_limits(void)
{
    const size_t count = write_full(packet, sizeof packet);
    TEST_ASSERT_EQUAL_UINT(count, wire_packet_bytes(packet));
    packet[4] = 2;   /* another version: still so long */
    TEST_ASSERT_EQUAL_UINT(count, wire_packet_bytes(packet));
    packet[11] = 1;
    TEST_ASSERT_EQUAL_UINT(0, wire_packet_bytes(packet));
    write_full(packet, sizeof packet);
    packet[8] = 143;
    TEST_ASSERT_EQUAL_UINT(0, wire_packet_bytes(packet));
    write_full(packet, sizeof packet);
    packet[0] = 't';
    TEST_ASSERT_EQUAL_UINT(0, wire_packet_bytes(packet));
}

/* 4096 patches of level 2 fit into what the header promises, and all patches of level 3 into the
 * most. */
static void the_named_sizes_hold_every_patch(void)
{
    static struct wire_feature all[WIRE_FEATURES];
    for (uint8_t i = 0; i < WIRE_FEATURES; i++) {
        all[i] = feature(i, i * 65536, i * 30000);
    }
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_begin(&writer, packet, WIRE_PACKET_BYTES_LEVEL_2, &full));
    for (uint16_t id = 0; id < WIRE_IDS; id++) {
        TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_put_patch(&writer, id, all, WIRE_FEATURES_LEVEL_2));
    }
    TEST_ASSERT_EQUAL_UINT(WIRE_PACKET_BYTES_LEVEL_2, wire_finish(&writer));
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_decode(packet, WIRE_PACKET_BYTES_LEVEL_2, &view));
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_begin(&writer, packet, WIRE_PACKET_BYTES_MAX, &full));
    for (uint16_t id = 0; id < WIRE_IDS; id++) {
        TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_put_patch(&writer, id, all, WIRE_FEATURES));
    }
    const size_t count = wire_finish(&writer);
    TEST_ASSERT_EQUAL_UINT(WIRE_HEADER_BYTES + WIRE_IDS * WIRE_PATCH_BYTES_MAX, count);
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_decode(packet, count, &view));
    TEST_ASSERT_EQUAL_UINT32(4096 * 85, view.header.feature_count);
}

static void every_status_has_its_own_sentence(void)
{
    for (int i = 0; i < WIRE_STATUS_COUNT; i++) {
        TEST_ASSERT_NOT_NULL(wire_status_text((enum wire_status)i));
        for (int j = 0; j < i; j++) {
            TEST_ASSERT_TRUE(strcmp(wire_status_text((enum wire_status)i),
                                    wire_status_text((enum wire_status)j)) != 0);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(every_byte_of_a_full_packet_is_the_golden_one);
    RUN_TEST(the_smallest_packet_is_the_golden_one);
    RUN_TEST(extremes_of_every_field_are_the_golden_ones);
    RUN_TEST(level_3_patches_are_the_golden_ones);
    RUN_TEST(what_was_written_is_read_again);
    RUN_TEST(walking_over_patches_alone_finds_them_all);
    RUN_TEST(a_longer_header_is_skipped_and_ignore_bits_are_ignored);
    RUN_TEST(every_sample_has_the_status_that_it_names);
    RUN_TEST(every_cut_and_every_turned_bit_is_refused);
    RUN_TEST(a_full_packet_says_so_keeps_what_it_had_and_takes_no_more);
    RUN_TEST(an_exact_fit_is_not_truncated);
    RUN_TEST(no_room_for_the_header_gives_no_packet);
    RUN_TEST(the_encoder_refuses_what_the_decoder_would);
    RUN_TEST(a_refused_patch_leaves_the_packet_as_it_was);
    RUN_TEST(positions_come_back_within_half_a_step);
    RUN_TEST(fraction_bits_are_the_most_that_fit);
    RUN_TEST(a_prefix_tells_the_length_only_within_limits);
    RUN_TEST(the_named_sizes_hold_every_patch);
    RUN_TEST(every_status_has_its_own_sentence);
    return UNITY_END();
}
