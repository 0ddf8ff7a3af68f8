/* Decoding, from ideal marks of patches laid out by the target's geometry. */
#include "firmware/detect/patches.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "tests/unit/synth.h"

#define WIDTH  1200u
#define HEIGHT 900u

static struct marks marks;
static struct patches patches;
static struct target target;
static void *memory;

static void take_all(struct arena *arena, const struct patches_settings *settings)
{
    marks_init(&marks, arena, WIDTH, HEIGHT);
    patches_init(&patches, arena, settings, WIDTH, HEIGHT);
}

static void start(unsigned levels, const struct target *on)
{
    const struct patches_settings settings = {.levels = (uint8_t)levels, .circle_ratio_q16 = 32768,
                                              .target = on};
    struct arena arena = {0};
    take_all(&arena, &settings);
    free(memory);
    memory = malloc(arena.used);
    TEST_ASSERT_NOT_NULL(memory);
    memset(memory, 0x5a, arena.used);
    arena = (struct arena){.base = memory, .size = arena.used};
    take_all(&arena, &settings);
}

void setUp(void) {}
void tearDown(void)
{
    free(memory);
    memory = NULL;
}

static struct ellipses_item items[4096];
static struct ellipses ellipses = {.at = items, .size = 4096};

/* The circles of a patch as ellipses, but `without` (or 255), each centre off by `noise` px both ways. */
static void add_patch(const struct synth_map *map, unsigned levels, const struct synth_patch *patch,
                      unsigned without, double noise, uint64_t *seed)
{
    for (unsigned i = 0; i < layout_feature_count(levels); i++) {
        const struct synth_circle c = synth_feature(map, levels, patch, i);
        if (i != without && c.x > c.size && c.y > c.size && c.x < WIDTH - 1 - c.size &&
            c.y < HEIGHT - 1 - c.size) {
            TEST_ASSERT_TRUE(ellipses.count < 4096);
            const bool white = layout_circle_is_white(levels, patch->id, i) !=
                               (patch->bad_parity && i == LAYOUT_ANCHOR);
            items[ellipses.count++] = (struct ellipses_item){
                .ellipse = {(int32_t)lrint((c.x + synth_normal(seed, noise)) * 65536),
                            (int32_t)lrint((c.y + synth_normal(seed, noise)) * 65536),
                            (int32_t)lrint(c.shape_xx * 4096), (int32_t)lrint(c.shape_xy * 4096),
                            (int32_t)lrint(c.shape_yy * 4096)},
                .gradient_mean_q3 = 4000,
                .white = white};
        }
    }
}

static void decode(unsigned levels)
{
    marks_classify(&ellipses, patches_size_ratio_q8(levels), &marks);
    patches_decode(&marks, &patches);
    for (uint32_t i = 1; i < patches.count; i++) { /* by rising id, none twice */
        TEST_ASSERT_TRUE(patches.at[i - 1].id < patches.at[i].id);
    }
}

static const struct patch *found(uint16_t id)
{
    for (uint32_t i = 0; i < patches.count; i++) {
        if (patches.at[i].id == id) {
            return &patches.at[i];
        }
    }
    return NULL;
}

/* Every feature of the patch is the mark of the right circle. */
static void check_patch(const struct synth_map *map, unsigned levels, const struct synth_patch *patch)
{
    const struct patch *p = found(patch->id);
    TEST_ASSERT_NOT_NULL(p);
    TEST_ASSERT_EQUAL_UINT16(layout_feature_count(levels), p->feature_count);
    for (unsigned i = 0; i < layout_feature_count(levels); i++) {
        const struct synth_circle c = synth_feature(map, levels, patch, i);
        TEST_ASSERT_TRUE(p->marks[i] < marks.count);
        const struct ellipse *e = &marks.at[p->marks[i]].ellipse;
        /* Another circle would be a diameter away at least. */
        SYNTH_NEAR(c.size / 2, c.x, e->x_px_q16 / 65536.0);
        SYNTH_NEAR(c.size / 2, c.y, e->y_px_q16 / 65536.0);
    }
}

/* Twelve patches, ids at random and unlike, every other one turned. */
static void make_board(struct synth_patch board[12], uint64_t *seed)
{
    const uint16_t start_id = (uint16_t)(synth_u64(seed) % 4096);
    for (unsigned i = 0; i < 12; i++) {
        board[i] = (struct synth_patch){.id = (uint16_t)((start_id + i * 1361) % 4096),
                                        .col = (int)(i % 4), .row = (int)(i / 4),
                                        .turned = (synth_u64(seed) & 1) != 0};
    }
}

static void patches_are_read_from_every_direction(void)
{
    uint64_t seed = 81;
    start(2, NULL);
    for (unsigned round = 0; round < 150; round++) {
        struct synth_patch board[12];
        make_board(board, &seed);
        /* Every roll, tilts to 60 degrees: 110 px a patch in the middle, circles from 3 px. */
        const struct synth_map map = synth_view(1100, 10, 2 * SYNTH_PI * round / 150,
                                                1.05 * synth_uniform(&seed), 2, 1.5, 600, 450);
        ellipses.count = 0;
        for (unsigned i = 0; i < 12; i++) {
            add_patch(&map, 2, &board[i], 255, 0.03, &seed);
        }
        decode(2);
        TEST_ASSERT_EQUAL_UINT32(12, patches.count);
        TEST_ASSERT_EQUAL_UINT32(0, patches.bad_parity + patches.not_on_target + patches.twice);
        TEST_ASSERT_FALSE(patches.truncated);
        for (unsigned i = 0; i < 12; i++) {
            check_patch(&map, 2, &board[i]);
        }
    }
}

static void every_id_is_read_as_itself(void)
{
    uint64_t seed = 82;
    start(2, NULL);
    const struct synth_map map = synth_view(1100, 10, 0.4, 0.5, 2, 1.5, 600, 450);
    for (unsigned id = 0; id < 4096; id += 12) {
        struct synth_patch board[12];
        ellipses.count = 0;
        for (unsigned i = 0; i < 12; i++) {
            board[i] = (struct synth_patch){.id = (uint16_t)((id + i) % 4096), .col = (int)(i % 4),
                                            .row = (int)(i / 4), .turned = i % 5 == 0};
            add_patch(&map, 2, &board[i], 255, 0, &seed);
        }
        decode(2);
        TEST_ASSERT_EQUAL_UINT32(12, patches.count);
        for (unsigned i = 0; i < 12; i++) {
            check_patch(&map, 2, &board[i]);
        }
    }
}

static void patches_of_three_levels_are_read_whole(void)
{
    uint64_t seed = 83;
    start(3, NULL);
    for (unsigned round = 0; round < 30; round++) {
        struct synth_patch board[12];
        make_board(board, &seed);
        const struct synth_map map = synth_view(1100, 5.5, 2 * SYNTH_PI * round / 30,
                                                0.7 * synth_uniform(&seed), 1, 1, 600, 450);
        ellipses.count = 0;
        for (unsigned i = 0; i < 4; i++) {
            board[i].col = (int)(i % 2);
            board[i].row = (int)(i / 2);
            add_patch(&map, 3, &board[i], 255, 0.03, &seed);
        }
        decode(3);
        TEST_ASSERT_EQUAL_UINT32(4, patches.count);
        for (unsigned i = 0; i < 4; i++) {
            check_patch(&map, 3, &board[i]);
        }
    }
}

static void anchor_of_the_wrong_parity_is_refused_and_counted(void)
{
    uint64_t seed = 84;
    start(2, NULL);
    const struct synth_map map = synth_view(1100, 10, 0.4, 0.5, 2, 1.5, 600, 450);
    struct synth_patch board[12];
    make_board(board, &seed);
    board[5].bad_parity = true;
    ellipses.count = 0;
    for (unsigned i = 0; i < 12; i++) {
        add_patch(&map, 2, &board[i], 255, 0.03, &seed);
    }
    decode(2);
    TEST_ASSERT_EQUAL_UINT32(11, patches.count);
    TEST_ASSERT_NULL(found(board[5].id));
    TEST_ASSERT_TRUE(patches.bad_parity >= 1);
}

static void patch_that_lacks_any_one_circle_is_refused(void)
{
    uint64_t seed = 85;
    start(2, NULL);
    const struct synth_map map = synth_view(1100, 10, 0.4, 0.5, 2, 1.5, 600, 450);
    struct synth_patch board[12];
    make_board(board, &seed);
    for (unsigned without = 0; without < 13; without++) {
        ellipses.count = 0;
        for (unsigned i = 0; i < 12; i++) {
            add_patch(&map, 2, &board[i], i == 6 ? without : 255, 0.03, &seed);
        }
        decode(2);
        TEST_ASSERT_EQUAL_UINT32(11, patches.count);
        TEST_ASSERT_NULL(found(board[6].id));
    }
}

static void make_target(const struct synth_patch board[12], uint16_t count)
{
    memset(&target, 0, sizeof target);
    target.rows = 1;
    target.cols = count;
    target.levels = 2;
    target.circle_ratio_q16 = 32768;
    target.edge_level_q16 = 52429;
    target.gauss_sigma_q16 = 26214;
    target.patch_nm = 100000000;
    for (unsigned i = 0; i < count; i++) {
        target.ids[i] = board[i].id;
    }
    unsigned bad;
    TEST_ASSERT_EQUAL_INT(TARGET_OK, target_prepare(&target, &bad));
}

static void id_that_is_not_on_the_target_is_refused_and_counted(void)
{
    uint64_t seed = 86;
    const struct synth_map map = synth_view(1100, 10, 0.4, 0.5, 2, 1.5, 600, 450);
    struct synth_patch board[12];
    make_board(board, &seed);
    make_target(board, 11);
    start(2, &target);
    ellipses.count = 0;
    for (unsigned i = 0; i < 12; i++) {
        add_patch(&map, 2, &board[i], 255, 0.03, &seed);
    }
    decode(2);
    TEST_ASSERT_EQUAL_UINT32(11, patches.count);
    TEST_ASSERT_NULL(found(board[11].id));
    TEST_ASSERT_TRUE(patches.not_on_target >= 1);
}

static void id_claimed_by_two_or_three_places_is_refused_and_counted(void)
{
    uint64_t seed = 87;
    start(2, NULL);
    const struct synth_map map = synth_view(1100, 10, 0.4, 0.5, 2, 1.5, 600, 450);
    struct synth_patch board[12];
    for (unsigned claims = 2; claims <= 4; claims++) {
        make_board(board, &seed);
        for (unsigned i = 1; i < claims; i++) {
            board[2 + 3 * i - 3].id = board[11].id;
        }
        ellipses.count = 0;
        for (unsigned i = 0; i < 12; i++) {
            add_patch(&map, 2, &board[i], 255, 0.03, &seed);
        }
        decode(2);
        TEST_ASSERT_EQUAL_UINT32(12 - claims, patches.count);
        TEST_ASSERT_NULL(found(board[11].id));
        TEST_ASSERT_TRUE(patches.twice >= 1);
    }
}

/* Seen in a mirror a patch looks like another one, for its circles lie symmetrically: only the target can
 * tell. Bits 0..3 then stand for 10, 9, 8, 11 and so on, so ids of one lot are not mirrored ones of it. */
static void mirrored_board_is_refused_by_its_target(void)
{
    uint64_t seed = 88;
    struct synth_map map = synth_view(1100, 10, 0.4, 0.5, 2, 1.5, 600, 450);
    for (unsigned i = 0; i < 3; i++) { /* x -> 1200 - x */
        map.at[i] = 1200 * map.at[6 + i] - map.at[i];
    }
    struct synth_patch board[12];
    make_board(board, &seed);
    make_target(board, 12);
    start(2, &target);
    ellipses.count = 0;
    for (unsigned i = 0; i < 12; i++) {
        add_patch(&map, 2, &board[i], 255, 0.03, &seed);
    }
    decode(2);
    TEST_ASSERT_EQUAL_UINT32(0, patches.count);
    TEST_ASSERT_EQUAL_UINT32(12, patches.not_on_target);
}

static void circles_strewn_at_random_give_no_patch(void)
{
    uint64_t seed = 89;
    start(2, NULL);
    unsigned wrong = 0;
    for (unsigned round = 0; round < 20; round++) {
        ellipses.count = 0;
        for (unsigned i = 0; i < 900; i++) {
            const double r = i % 13 ? 5.2 : 10.4;
            items[ellipses.count++] = (struct ellipses_item){
                .ellipse = {(int32_t)(65536 * (20 + 1160 * synth_uniform(&seed))),
                            (int32_t)(65536 * (20 + 860 * synth_uniform(&seed))),
                            (int32_t)(r * r * 4096), 0, (int32_t)(r * r * 4096)},
                .gradient_mean_q3 = 4000, .white = (synth_u64(&seed) & 1) != 0};
        }
        decode(2);
        wrong += patches.count;
    }
    TEST_ASSERT_EQUAL_UINT(0, wrong);
}

static void patches_cut_by_the_border_are_left_out_and_others_kept(void)
{
    uint64_t seed = 90;
    start(2, NULL);
    struct synth_patch board[12];
    make_board(board, &seed);
    /* The board's right column lies half outside. */
    const struct synth_map map = synth_view(1100, 5, 0, 0.2, 3.5, 1.5, 1190, 450);
    unsigned whole = 0;
    ellipses.count = 0;
    for (unsigned i = 0; i < 12; i++) {
        const uint32_t before = ellipses.count;
        add_patch(&map, 2, &board[i], 255, 0.03, &seed);
        whole += ellipses.count == before + 13;
    }
    TEST_ASSERT_TRUE(whole >= 6 && whole < 12);
    decode(2);
    TEST_ASSERT_EQUAL_UINT32(whole, patches.count);
}

static void no_marks_give_no_patches(void)
{
    start(2, NULL);
    ellipses.count = 0;
    decode(2);
    TEST_ASSERT_EQUAL_UINT32(0, patches.count);
    TEST_ASSERT_EQUAL_UINT32(0, patches.anchors);
}

/* At two levels 2h over h; at three the common features are the satellites, of inradius p / 4. */
/* Of twelve patches those whose turn comes after the limit are left out, and the list says so. */
static void looks_have_a_limit_that_is_reported(void)
{
    uint64_t seed = 88;
    start(2, NULL);
    struct synth_patch board[12];
    make_board(board, &seed);
    const struct synth_map map = synth_view(1100, 10, 0.3, 0.2, 2, 1.5, 600, 450);
    ellipses.count = 0;
    for (unsigned i = 0; i < 12; i++) {
        add_patch(&map, 2, &board[i], 255, 0.03, &seed);
    }
    patches.looks_max = 300;
    decode(2);
    TEST_ASSERT_TRUE(patches.truncated);
    TEST_ASSERT_TRUE(patches.count > 0 && patches.count < 12);
    for (uint32_t i = 0; i < patches.count; i++) {
        TEST_ASSERT_EQUAL_UINT16(13, patches.at[i].feature_count);
    }
}

static void size_ratio_is_that_of_the_layout(void)
{
    TEST_ASSERT_EQUAL_UINT32(512, patches_size_ratio_q8(2));
    const double h = (sqrt(2) - 1) / 4;
    const double satellite = (2 - sqrt(2)) / 4 / 4;
    const double bit = h / 2;
    const double ratio = patches_size_ratio_q8(3) / 256.0;
    /* "the common features": between the ratios to the bits' circles and to the satellites. */
    TEST_ASSERT_TRUE(ratio >= 2 * h / bit - 0.01 && ratio <= 2 * h / satellite + 0.01);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(patches_are_read_from_every_direction);
    RUN_TEST(every_id_is_read_as_itself);
    RUN_TEST(patches_of_three_levels_are_read_whole);
    RUN_TEST(anchor_of_the_wrong_parity_is_refused_and_counted);
    RUN_TEST(patch_that_lacks_any_one_circle_is_refused);
    RUN_TEST(id_that_is_not_on_the_target_is_refused_and_counted);
    RUN_TEST(id_claimed_by_two_or_three_places_is_refused_and_counted);
    RUN_TEST(mirrored_board_is_refused_by_its_target);
    RUN_TEST(circles_strewn_at_random_give_no_patch);
    RUN_TEST(patches_cut_by_the_border_are_left_out_and_others_kept);
    RUN_TEST(no_marks_give_no_patches);
    RUN_TEST(looks_have_a_limit_that_is_reported);
    RUN_TEST(size_ratio_is_that_of_the_layout);
    return UNITY_END();
}
