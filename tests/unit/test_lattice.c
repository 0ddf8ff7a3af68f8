/* Completing patches from their neighbours, on drawn boards with known truth. */
#include "firmware/detect/lattice.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "firmware/app/pipeline.h"
#include "tests/unit/synth.h"

#define WIDTH  440u
#define HEIGHT 330u
#define COLS   4u
#define ROWS   3u
#define BOARD  (COLS * ROWS)
#define SIGMAS 6.0 /* a Rayleigh tail of 1.5e-8 */
#define BIAS   0.03 /* px: what neighbours' edges do to circles of 3 px and more */

static struct pipeline pipeline; /* decodes without a target; the lattice then gets one */
static struct target target;
static uint8_t *memory;
static uint8_t bytes[WIDTH * HEIGHT * 2];
static struct synth_image picture;
static struct synth_map map;
static struct synth_patch board[BOARD];
static struct frame_view frame;

/* Target of `rows` rows; those beyond the drawn ones are not there. */
static void make_target(unsigned rows)
{
    memset(&target, 0, sizeof target);
    target.rows = (uint16_t)rows;
    target.cols = COLS;
    target.levels = 2;
    target.circle_ratio_q16 = 32768;
    target.edge_level_q16 = 52429;
    target.gauss_sigma_q16 = 26214;
    target.patch_nm = 100000000;
    for (unsigned i = 0; i < rows * COLS; i++) {
        target.ids[i] = (uint16_t)(3900 - 331 * (i % 11) - i / 11);
        target.turns[i] = i % 3 == 1;
        if (i < BOARD) {
            board[i] = (struct synth_patch){.id = target.ids[i], .col = (int)(i % COLS),
                                            .row = (int)(i / COLS), .turned = i % 3 == 1};
        }
    }
    unsigned bad;
    TEST_ASSERT_EQUAL_INT(TARGET_OK, target_prepare(&target, &bad));
}

static void draw(double u0, double v0, double roll, double tilt)
{
    map = synth_view(750, 10, roll, tilt, u0, v0, WIDTH / 2.0, HEIGHT / 2.0);
    picture = synth_image_new(WIDTH, HEIGHT, 210);
    synth_patches(&picture, &map, 2, board, BOARD, 40, 210);
}

static void cover(unsigned x0, unsigned y0, unsigned x1, unsigned y1, double grey)
{
    for (unsigned y = y0; y < y1; y++) {
        for (unsigned x = x0; x < x1; x++) {
            picture.pixels[y * WIDTH + x] = grey;
        }
    }
}

/* Everything up to the lattice. */
static void decode(void)
{
    const struct pipeline_settings settings = pipeline_defaults();
    const size_t size = pipeline_bytes(WIDTH, HEIGHT);
    synth_blur(&picture, 0.7);
    synth_noise(&picture, 1, 77);
    frame = synth_frame(&picture, FRAME_GREY12, bytes);
    memory = malloc(size);
    TEST_ASSERT_NOT_NULL(memory);
    memset(memory, 0x5a, size);
    pipeline_init(&pipeline, memory, size, WIDTH, HEIGHT, &settings);
    pipeline_run(&pipeline, &frame);
}

static void extend(void)
{
    pipeline.patches.settings.target = &target;
    lattice_extend(&pipeline.lattice, &pipeline.refine, &frame, &pipeline.patches, &pipeline.marks);
}

void setUp(void)
{
    make_target(ROWS);
}

void tearDown(void)
{
    free(memory);
    memory = NULL;
    synth_image_free(&picture);
}

static const struct patch *found(uint16_t id)
{
    for (uint32_t i = 0; i < pipeline.patches.count; i++) {
        if (pipeline.patches.at[i].id == id) {
            return &pipeline.patches.at[i];
        }
    }
    return NULL;
}

static bool has(const struct synth_patch *patch, unsigned feature)
{
    const struct patch *p = found(patch->id);
    return p != NULL && p->marks[feature] != MARKS_NONE;
}

/* How far inside the frame the circle's rim lies, px; below 0 it is cut. */
static double inside(const struct synth_circle *c)
{
    const double x = fmin(c->x, WIDTH - 1 - c->x) - sqrt(c->shape_xx);
    const double y = fmin(c->y, HEIGHT - 1 - c->y) - sqrt(c->shape_yy);
    return fmin(x, y);
}

/* Every feature reported is where its circle is, in the colour it has; counts and order are right. */
static unsigned check_all(double bias)
{
    unsigned total = 0;
    for (uint32_t k = 0; k < pipeline.patches.count; k++) {
        const struct patch *p = &pipeline.patches.at[k];
        const struct synth_patch *drawn = NULL;
        unsigned features = 0;
        for (unsigned i = 0; i < BOARD; i++) {
            drawn = board[i].id == p->id ? &board[i] : drawn;
        }
        TEST_ASSERT_NOT_NULL(drawn);
        TEST_ASSERT_TRUE(k == 0 || pipeline.patches.at[k - 1].id < p->id);
        for (unsigned i = 0; i < LAYOUT_FEATURES_MAX; i++) {
            if (p->marks[i] == MARKS_NONE) {
                continue;
            }
            TEST_ASSERT_TRUE(i < 13 && p->marks[i] < pipeline.marks.count);
            const struct mark *m = &pipeline.marks.at[p->marks[i]];
            const struct synth_circle c = synth_feature(&map, 2, drawn, i);
            TEST_ASSERT_TRUE(m->white == layout_circle_is_white(2, p->id, i));
            const double off = hypot(m->ellipse.x_px_q16 / 65536.0 - c.x,
                                     m->ellipse.y_px_q16 / 65536.0 - c.y);
            TEST_ASSERT_TRUE(off < SIGMAS * m->sigma_px_q20 / 1048576.0 + bias);
            features++;
        }
        TEST_ASSERT_EQUAL_UINT(features, p->feature_count);
        total += features;
    }
    return total;
}

static void patches_cut_by_the_frame_get_every_circle_that_is_inside(void)
{
    static const double views[][4] = {{3.5, 1.5, 0, 0}, {0.4, 0.4, 0.5, 0.3}, {2, 3.2, 0.8, 0.5},
                                      {3.8, 2.8, -2, 0.2}};
    for (unsigned k = 0; k < 4; k++) {
        draw(views[k][0], views[k][1], views[k][2], views[k][3]);
        decode();
        const unsigned before = check_all(BIAS);
        extend();
        const unsigned after = check_all(BIAS);
        TEST_ASSERT_EQUAL_UINT(after, before + pipeline.lattice.added);
        TEST_ASSERT_TRUE(pipeline.lattice.added >= 5);
        unsigned visible = 0;
        unsigned missed = 0;
        for (unsigned i = 0; i < BOARD; i++) {
            for (unsigned f = 0; f < 13; f++) {
                const struct synth_circle c = synth_feature(&map, 2, &board[i], f);
                /* Half a radius around the circle is inside too. */
                if (inside(&c) > 0.5 * c.size) {
                    visible++;
                    missed += !has(&board[i], f);
                } else if (inside(&c) < -0.5) {
                    TEST_ASSERT_FALSE(has(&board[i], f));
                }
            }
        }
        /* Predictions reach two patches beyond what is read, but where a cut patch has too few neighbours
         * a map of second order bends away: one in thirty. */
        TEST_ASSERT_TRUE(missed * 30 <= visible);
        tearDown();
    }
}

/* A rectangle lies over the corner where four patches meet: what it touches is gone or right, all else is
 * found, although none of the four can be read by itself. */
static void patches_covered_in_part_keep_what_is_seen(void)
{
    static const double greys[] = {0, 125, 255};
    for (unsigned k = 0; k < 3; k++) {
        draw(2, 1.5, 0.3, 0.3);
        double x;
        double y;
        synth_map_point(&map, 2, 2, &x, &y);
        const double half = 18;
        cover((unsigned)(x - half), (unsigned)(y - half), (unsigned)(x + half), (unsigned)(y + half),
              greys[k]);
        decode();
        TEST_ASSERT_TRUE(pipeline.patches.count <= 10);
        extend();
        /* test_refine.c says what a rim covered by a fifth does: under 1 px; here r = 4, so 0.2 r. */
        (void)check_all(0.8);
        TEST_ASSERT_EQUAL_UINT32(BOARD, pipeline.patches.count);
        for (unsigned i = 0; i < BOARD; i++) {
            for (unsigned f = 0; f < 13; f++) {
                const struct synth_circle c = synth_feature(&map, 2, &board[i], f);
                const double away = fmax(fabs(c.x - x), fabs(c.y - y)) - half;
                if (away > 2 * c.size + 3) { /* the triangle around it is clear too */
                    TEST_ASSERT_TRUE(has(&board[i], f));
                } else if (away < -1) {
                    TEST_ASSERT_FALSE(has(&board[i], f));
                }
            }
        }
        tearDown();
    }
}

/* The target has two more rows than the board that is seen: paper, noise or another board's circles are there. */
static void nothing_is_invented_where_the_board_ends(void)
{
    for (unsigned k = 0; k < 3; k++) {
        make_target(5);
        draw(2, 2.5, 0, 0.2);
        double x;
        double y;
        synth_map_point(&map, 2, 3.05, &x, &y);
        uint64_t seed = 7;
        for (unsigned row = (unsigned)y; row < HEIGHT && k > 0; row++) {
            for (unsigned col = 0; col < WIDTH; col++) {
                picture.pixels[row * WIDTH + col] =
                    k == 1 ? 255 * synth_uniform(&seed) : 125 + 85 * cos(col * 0.4) * cos(row * 0.4);
            }
        }
        decode();
        extend();
        (void)check_all(BIAS); /* finds only what is drawn */
        TEST_ASSERT_TRUE(pipeline.patches.count >= 8);
        tearDown();
    }
}

static void board_that_is_seen_whole_is_left_as_it_is(void)
{
    static struct patch before[BOARD];
    draw(2, 1.5, 0.4, 0.3);
    decode();
    TEST_ASSERT_EQUAL_UINT32(BOARD, pipeline.patches.count);
    TEST_ASSERT_EQUAL_UINT(13 * BOARD, check_all(BIAS));
    memcpy(before, pipeline.patches.at, sizeof before);
    extend();
    TEST_ASSERT_EQUAL_UINT32(0, pipeline.lattice.added);
    TEST_ASSERT_EQUAL_UINT32(BOARD, pipeline.patches.count);
    TEST_ASSERT_EQUAL_MEMORY(before, pipeline.patches.at, sizeof before);
}

static void without_a_target_nothing_changes(void)
{
    static struct patch before[BOARD];
    draw(3.5, 1.5, 0, 0);
    decode();
    const uint32_t count = pipeline.patches.count;
    const uint32_t marks = pipeline.marks.count;
    memcpy(before, pipeline.patches.at, count * sizeof before[0]);
    pipeline.lattice.added = 7;
    lattice_extend(&pipeline.lattice, &pipeline.refine, &frame, &pipeline.patches, &pipeline.marks);
    TEST_ASSERT_EQUAL_UINT32(0, pipeline.lattice.added);
    TEST_ASSERT_EQUAL_UINT32(count, pipeline.patches.count);
    TEST_ASSERT_EQUAL_UINT32(marks, pipeline.marks.count);
    TEST_ASSERT_EQUAL_MEMORY(before, pipeline.patches.at, count * sizeof before[0]);
}

static void nothing_read_gives_nothing(void)
{
    picture = synth_image_new(WIDTH, HEIGHT, 210);
    decode();
    extend();
    TEST_ASSERT_EQUAL_UINT32(0, pipeline.lattice.added);
    TEST_ASSERT_EQUAL_UINT32(0, pipeline.patches.count);
}

static void lists_that_are_full_say_so_and_keep_what_they_had(void)
{
    for (unsigned list = 0; list < 3; list++) {
        draw(3.5, 1.5, 0, 0);
        decode();
        const uint32_t count = pipeline.patches.count;
        const unsigned before = check_all(BIAS);
        if (list == 0) {
            pipeline.marks.size = pipeline.marks.count;
        } else if (list == 1) {
            pipeline.marks.size = pipeline.marks.count + 2;
        } else {
            pipeline.patches.size = pipeline.patches.count;
        }
        extend();
        TEST_ASSERT_TRUE(pipeline.lattice.truncated);
        TEST_ASSERT_TRUE(pipeline.marks.count <= pipeline.marks.size);
        TEST_ASSERT_EQUAL_UINT(before + (list == 1 ? 2 : 0), check_all(BIAS));
        TEST_ASSERT_TRUE(list == 1 || pipeline.patches.count == count);
        /* And with room again it is as if nothing had been. */
        pipeline.marks.size += 100;
        pipeline.patches.size += list == 2 ? 10 : 0;
        extend();
        TEST_ASSERT_FALSE(pipeline.lattice.truncated);
        TEST_ASSERT_TRUE(check_all(BIAS) > before + 2);
        tearDown();
    }
}

static unsigned looks;

static void counting_rows(const struct rimrow_view *view, unsigned count, struct rimrow_batch *batch)
{
    looks++;
    dsp_scalar.rim_rows(view, count, batch);
}

/* Else a frame with too many small circles pays for every one that has no room. */
static void no_pixel_is_looked_at_for_marks_that_have_no_room(void)
{
    struct dsp_kernels counting = dsp_scalar;
    counting.rim_rows = counting_rows;
    draw(3.5, 1.5, 0, 0);
    decode();
    pipeline.refine.fit.rim.dsp = &counting;
    pipeline.marks.size = pipeline.marks.count;
    looks = 0;
    extend();
    TEST_ASSERT_EQUAL_UINT(0, looks);
    pipeline.marks.size += 100;
    extend();
    TEST_ASSERT_TRUE(looks > 10);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(patches_cut_by_the_frame_get_every_circle_that_is_inside);
    RUN_TEST(patches_covered_in_part_keep_what_is_seen);
    RUN_TEST(nothing_is_invented_where_the_board_ends);
    RUN_TEST(board_that_is_seen_whole_is_left_as_it_is);
    RUN_TEST(without_a_target_nothing_changes);
    RUN_TEST(nothing_read_gives_nothing);
    RUN_TEST(lists_that_are_full_say_so_and_keep_what_they_had);
    RUN_TEST(no_pixel_is_looked_at_for_marks_that_have_no_room);
    return UNITY_END();
}
