/* Marks and patches laid by hand, packed, and read back by the wire's decoder. */
#include "firmware/detect/packet.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "tests/unit/synth.h"

#define WIDTH  640u
#define HEIGHT 480u

static struct packet packet;
static struct mark all_marks[400];
static struct patch all_patches[20];
static struct marks marks = {.at = all_marks};
static struct patches patches = {.at = all_patches, .settings = {.levels = 2}};
static void *memory;

void setUp(void)
{
    struct arena arena = {0};
    packet_init(&packet, &arena, WIDTH, HEIGHT);
    memory = malloc(arena.used);
    TEST_ASSERT_NOT_NULL(memory);
    arena = (struct arena){.base = memory, .size = arena.used};
    packet_init(&packet, &arena, WIDTH, HEIGHT);
    marks.count = 0;
    patches.count = 0;
}
void tearDown(void)
{
    free(memory);
}

static struct wire_header about(void)
{
    struct wire_header header = {.camera_serial = "test", .sequence = 7, .t_capture_ns = -5,
                                 .width_px = WIDTH, .height_px = HEIGHT, .settings_digest = 99,
                                 .truncated = WIRE_TRUNCATED_ELLIPSES};
    return header;
}

static uint32_t add_mark(double x, double y)
{
    struct mark *m = &all_marks[marks.count];
    *m = (struct mark){.ellipse = {(int32_t)floor(x * 65536), (int32_t)floor(y * 65536), 40960, 0, 40960},
                       .size_px_q16 = 65536 * (2 + marks.count % 7),
                       .sigma_px_q20 = 10000 + 500 * (marks.count % 11)};
    return marks.count++;
}

static struct patch *add_patch(uint16_t id, unsigned features, uint64_t *seed)
{
    struct patch *p = &all_patches[patches.count++];
    p->id = id;
    p->feature_count = (uint16_t)features;
    for (unsigned i = 0; i < LAYOUT_FEATURES_MAX; i++) {
        p->marks[i] = MARKS_NONE;
    }
    for (unsigned i = 0; i < features; i++) {
        p->marks[i] = add_mark(WIDTH * synth_uniform(seed) - 0.5, HEIGHT * synth_uniform(seed) - 0.5);
    }
    return p;
}

static struct wire_packet_view build(void)
{
    const struct wire_header header = about();
    struct wire_packet_view view;
    TEST_ASSERT_TRUE(packet_build(&packet, &header, &marks, &patches));
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_decode(packet.bytes, packet.used, &view));
    TEST_ASSERT_EQUAL_UINT32(packet.features, view.header.feature_count);
    return view;
}

static void features_come_back_within_the_wires_steps(void)
{
    uint64_t seed = 91;
    for (unsigned i = 0; i < 20; i++) {
        add_patch((uint16_t)(i * 200), 13, &seed);
    }
    const struct wire_packet_view view = build();
    TEST_ASSERT_EQUAL_STRING("test", view.header.camera_serial);
    TEST_ASSERT_EQUAL_UINT16(WIRE_TRUNCATED_ELLIPSES, view.header.truncated);
    TEST_ASSERT_EQUAL_UINT16(20, view.header.patch_count);
    struct wire_patch_cursor cursor = wire_patches(&view);
    for (unsigned i = 0; i < 20; i++) {
        TEST_ASSERT_TRUE(wire_next_patch(&cursor));
        TEST_ASSERT_EQUAL_UINT16(i * 200, cursor.patch_id);
        for (unsigned k = 0; k < 13; k++) {
            struct wire_feature f;
            const struct mark *m = &all_marks[all_patches[i].marks[k]];
            TEST_ASSERT_TRUE(wire_next_feature(&cursor, &f));
            TEST_ASSERT_EQUAL_UINT8(k, f.index);
            /* Half a step of 2^-fraction_bits, and a whole one at the border, where rounding up would leave
             * the image. */
            const double step = 1.0 / (1 << view.header.fraction_bits);
            SYNTH_NEAR(step, m->ellipse.x_px_q16 / 65536.0, f.x_px_q16 / 65536.0);
            SYNTH_NEAR(step, m->ellipse.y_px_q16 / 65536.0, f.y_px_q16 / 65536.0);
            /* Codes stand a third of an octave apart: at most a sixth off, 2^(1/6) = 1.123. */
            SYNTH_NEAR(log(1.125), log(m->sigma_px_q20 / 1048576.0), log(f.sigma_px_q24 / 16777216.0));
            SYNTH_NEAR(log(1.125), log(m->size_px_q16 / 65536.0), log(f.size_px_q16 / 65536.0));
        }
        struct wire_feature none;
        TEST_ASSERT_FALSE(wire_next_feature(&cursor, &none));
    }
    TEST_ASSERT_FALSE(wire_next_patch(&cursor));
}

static void features_outside_the_image_are_left_out_and_patches_of_none_too(void)
{
    uint64_t seed = 92;
    struct patch *partly = add_patch(3, 13, &seed);
    struct patch *outside = add_patch(5, 13, &seed);
    add_patch(9, 13, &seed);
    all_marks[partly->marks[0]].ellipse.x_px_q16 = -32769;                  /* just left of -0.5 */
    all_marks[partly->marks[4]].ellipse.y_px_q16 = (int32_t)(HEIGHT * 65536 - 32768); /* on the edge */
    all_marks[partly->marks[7]].ellipse.x_px_q16 = -32768;                  /* the last one inside */
    for (unsigned i = 0; i < 13; i++) {
        all_marks[outside->marks[i]].ellipse.x_px_q16 = (int32_t)((WIDTH + 3) * 65536);
    }
    const struct wire_packet_view view = build();
    TEST_ASSERT_EQUAL_UINT16(2, view.header.patch_count);
    TEST_ASSERT_EQUAL_UINT32(11 + 13, view.header.feature_count);
    struct wire_patch_cursor cursor = wire_patches(&view);
    TEST_ASSERT_TRUE(wire_next_patch(&cursor));
    TEST_ASSERT_EQUAL_UINT16(3, cursor.patch_id);
    struct wire_feature f;
    for (unsigned k = 0; k < 13; k++) {
        if (k != 0 && k != 4) {
            TEST_ASSERT_TRUE(wire_next_feature(&cursor, &f));
            TEST_ASSERT_EQUAL_UINT8(k, f.index);
        }
    }
    TEST_ASSERT_TRUE(wire_next_patch(&cursor));
    TEST_ASSERT_EQUAL_UINT16(9, cursor.patch_id);
}

static void features_that_were_not_found_leave_a_gap_in_the_indices(void)
{
    uint64_t seed = 93;
    struct patch *p = add_patch(4095, 13, &seed);
    p->marks[40] = add_mark(100, 100);
    p->marks[84] = add_mark(200, 100);
    p->feature_count = 15;
    patches.settings.levels = 3;
    const struct wire_packet_view view = build();
    patches.settings.levels = 2;
    TEST_ASSERT_EQUAL_UINT32(15, view.header.feature_count);
    struct wire_patch_cursor cursor = wire_patches(&view);
    TEST_ASSERT_TRUE(wire_next_patch(&cursor));
    struct wire_feature f;
    unsigned last = 0;
    while (wire_next_feature(&cursor, &f)) {
        last = f.index;
    }
    TEST_ASSERT_EQUAL_UINT(84, last);
}

static void frame_without_patches_is_a_packet_all_the_same(void)
{
    const struct wire_packet_view view = build();
    TEST_ASSERT_EQUAL_UINT16(0, view.header.patch_count);
    TEST_ASSERT_EQUAL_UINT32(WIRE_HEADER_BYTES, packet.used);
}

static void header_that_is_not_fit_gives_no_packet(void)
{
    struct wire_header header = about();
    header.camera_serial[0] = 0;
    TEST_ASSERT_FALSE(packet_build(&packet, &header, &marks, &patches));
    header = about();
    header.clock_kind = WIRE_CLOCK_COUNT;
    TEST_ASSERT_FALSE(packet_build(&packet, &header, &marks, &patches));
    header = about();
    TEST_ASSERT_TRUE(packet_build(&packet, &header, &marks, &patches)); /* and the next one is fine */
}

/* A picture can hold more patches than its packet has room for only by error; then the packet says so. */
static void packet_without_room_says_so_and_stays_readable(void)
{
    uint64_t seed = 94;
    for (unsigned i = 0; i < 20; i++) {
        add_patch((uint16_t)(i * 200), 13, &seed);
    }
    packet.size = WIRE_HEADER_BYTES + 5 * 100;
    const struct wire_packet_view view = build();
    TEST_ASSERT_TRUE((view.header.truncated & WIRE_TRUNCATED_PACKET) != 0);
    TEST_ASSERT_EQUAL_UINT16(5, view.header.patch_count);
    TEST_ASSERT_EQUAL_UINT32(65, packet.features);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(features_come_back_within_the_wires_steps);
    RUN_TEST(features_outside_the_image_are_left_out_and_patches_of_none_too);
    RUN_TEST(features_that_were_not_found_leave_a_gap_in_the_indices);
    RUN_TEST(frame_without_patches_is_a_packet_all_the_same);
    RUN_TEST(header_that_is_not_fit_gives_no_packet);
    RUN_TEST(packet_without_room_says_so_and_stays_readable);
    return UNITY_END();
}
