/* How the light falls: planes through what circles say of black and white. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "firmware/detect/light.h"
#include "tests/unit/synth.h"

#define CIRCLES 26u

static uint8_t memory[1 << 16];
static struct light light;
static struct mark list[CIRCLES];
static uint32_t cell[2]; /* one holds all */
static uint32_t in_cell[CIRCLES];
static struct marks marks;
static struct patch patch;

/* Half white, half black circles about (500, 400); black rises by `black` along x, white falls by `white`
 * along y, in shares of the range a pixel. */
static void make_marks(unsigned count, double black, double white)
{
    for (unsigned i = 0; i < count; i++) {
        const double x = 440 + 30 * (i % 5);
        const double y = 350 + 25 * (i / 5);
        const bool is_white = i % 2 == 0;
        const double level = is_white ? 0.1 + black * (x - 500) : 0.8 - white * (y - 400);
        list[i] = (struct mark){
            .ellipse = {(int32_t)lround(x * 65536), (int32_t)lround(y * 65536), 40960, 0, 40960},
            .size_px_q16 = 10 << 16,
            .level_q30 = (int32_t)lround(level * 1073741824),
            .contrast_q30 = is_white ? 1 << 29 : -(1 << 29),
            .white = is_white,
        };
        in_cell[i] = i;
    }
    cell[1] = count;
    marks = (struct marks){
        .at = list, .count = count, .size = CIRCLES, .by_cell = in_cell, .cells = cell, .columns = 1, .rows = 1};
    patch = (struct patch){.id = 1, .feature_count = 1};
    for (unsigned i = 0; i < LAYOUT_FEATURES_MAX; i++) {
        patch.marks[i] = MARKS_NONE;
    }
    patch.marks[LAYOUT_ANCHOR] = 12;
}

void setUp(void)
{
    struct arena arena = {.base = memory, .size = sizeof memory};
    light_init(&light, &arena);
}
void tearDown(void) {}

static void slopes_of_black_and_white_are_found_apart(void)
{
    make_marks(25, 2e-4, 5e-4);
    light_find(&light, &patch, &marks);
    /* Planes through points of a plane: exact but for Q30 through a pivot of 2^-10, 1e-6 of the range over
     * 100 px. */
    TEST_ASSERT_TRUE(fabs(patch.light.black.slope_q30[0] / 1073741824.0 - 2e-4) < 1e-7);
    TEST_ASSERT_TRUE(fabs(patch.light.black.slope_q30[1] / 1073741824.0) < 1e-7);
    TEST_ASSERT_TRUE(fabs(patch.light.white.slope_q30[0] / 1073741824.0) < 1e-7);
    TEST_ASSERT_TRUE(fabs(patch.light.white.slope_q30[1] / 1073741824.0 + 5e-4) < 1e-7);
}

static void few_circles_say_nothing(void)
{
    make_marks(13, 2e-4, 5e-4);
    for (unsigned i = 0; i < 4; i++) {
        list[2 * i].contrast_q30 = 0; /* not fitted: of seven white circles three are left */
    }
    light_find(&light, &patch, &marks);
    TEST_ASSERT_EQUAL_INT32(0, patch.light.black.slope_q30[0]);
    TEST_ASSERT_EQUAL_INT32(0, patch.light.white.slope_q30[1]);
}

/* Three white and three black circles of 25, a quarter, whose levels are off by 0.15 to 0.5 of the range, all to one
 * side or to both: hidden in part by something dark or bright. Planes that rise by 0.024 over the circles are no more
 * than that off their median level, and four medians of it, that again, and noise make 0.13: what is farther off is
 * left out at once. */
static void hide_a_quarter(unsigned round, bool hidden[CIRCLES], uint64_t *seed)
{
    memset(hidden, 0, CIRCLES * sizeof hidden[0]);
    for (unsigned colour = 0; colour < 2; colour++) {
        for (unsigned left = 3; left > 0;) {
            const unsigned i = 2 * (unsigned)(synth_u64(seed) % 12) + colour;
            if (!hidden[i]) {
                const double size = 0.15 + 0.35 * synth_uniform(seed);
                const bool down = round % 3 == 0 || (round % 3 == 1 && left % 2);
                list[i].level_q30 += (int32_t)lround((down ? -size : size) * 1073741824);
                hidden[i] = true;
                left--;
            }
        }
    }
}

/* The standard deviation of a plane's slope along x or y, whichever is larger, by the circles of this colour that are
 * not hidden. */
static double slope_sigma(bool white, const bool hidden[CIRCLES], double noise)
{
    double n = 0;
    double sum[2] = {0};
    double square[3] = {0};
    for (unsigned i = 0; i < 25; i++) {
        if (list[i].white == white && !hidden[i]) {
            const double x = list[i].ellipse.x_px_q16 / 65536.0 - 500;
            const double y = list[i].ellipse.y_px_q16 / 65536.0 - 400;
            n++;
            sum[0] += x;
            sum[1] += y;
            square[0] += x * x;
            square[1] += x * y;
            square[2] += y * y;
        }
    }
    const double xx = square[0] - sum[0] * sum[0] / n;
    const double xy = square[1] - sum[0] * sum[1] / n;
    const double yy = square[2] - sum[1] * sum[1] / n;
    return noise * sqrt(fmax(xx, yy) / (xx * yy - xy * xy));
}

static void circles_that_something_hides_do_not_tilt_the_planes(void)
{
    const double noise = 0.002; /* of the range: half a grey level */
    uint64_t seed = 91;
    for (unsigned round = 0; round < 300; round++) {
        bool hidden[CIRCLES];
        make_marks(25, 2e-4, 2e-4);
        for (unsigned i = 0; i < 25; i++) {
            list[i].level_q30 += (int32_t)lround(synth_normal(&seed, noise) * 1073741824);
        }
        hide_a_quarter(round, hidden, &seed);
        light_find(&light, &patch, &marks);
        /* Five sigma of 1200 slopes; and as few as two thirds of the others may agree within four medians (2.7 sigma)
         * of their first plane. */
        const double black = 5 * sqrt(1.5) * slope_sigma(true, hidden, noise);
        const double white = 5 * sqrt(1.5) * slope_sigma(false, hidden, noise);
        SYNTH_NEAR(black, 2e-4, patch.light.black.slope_q30[0] / 1073741824.0);
        SYNTH_NEAR(black, 0, patch.light.black.slope_q30[1] / 1073741824.0);
        SYNTH_NEAR(white, 0, patch.light.white.slope_q30[0] / 1073741824.0);
        SYNTH_NEAR(white, -2e-4, patch.light.white.slope_q30[1] / 1073741824.0);
    }
}

static void level_and_contrast_tilt_by_colour(void)
{
    const struct patch_light slopes = {
        .black = {.slope_q30 = {1000, 0}}, .white = {.slope_q30 = {5000, 200}}, .swing_q30 = 1 << 28};
    /* Circles whose swing is half of the full one, and a quarter: as a curve between print and picture makes it. */
    struct rim_view view = {.contrast_q30 = 1 << 27};
    light_tilt(&slopes, true, &view);
    TEST_ASSERT_EQUAL_INT(1000, view.level_slope_q30[0]);
    TEST_ASSERT_EQUAL_INT(2000, view.contrast_slope_q30[0]);
    TEST_ASSERT_EQUAL_INT(100, view.contrast_slope_q30[1]);
    view.contrast_q30 = -(1 << 26);
    light_tilt(&slopes, false, &view);
    TEST_ASSERT_EQUAL_INT(5000, view.level_slope_q30[0]);
    TEST_ASSERT_EQUAL_INT(-1000, view.contrast_slope_q30[0]);
}

/* Light about (470, 360) that bends: slopes at every circle, of black and of white. */
static void slopes_follow_light_that_bends(void)
{
    make_marks(25, 0, 0);
    list[25] = list[12]; /* 15 black ones */
    for (unsigned i = 0; i < CIRCLES; i++) {
        const double x = 440 + 20 * (i % 6) + 7 * (i % 2);
        const double y = 350 + 25 * (i / 6) - 3 * (i % 3);
        const double dx = x - 470;
        const double dy = y - 360;
        list[i].white = i % 2 == 0;
        list[i].contrast_q30 = list[i].white ? 1 << 29 : -(1 << 29);
        const double level = list[i].white ? 0.1 + 1e-4 * dx + 3e-6 * dx * dx - 2e-6 * dx * dy
                                           : 0.8 - 2e-4 * dy - 4e-6 * dy * dy + 1e-6 * dx * dx;
        list[i].ellipse.x_px_q16 = (int32_t)lround(x * 65536);
        list[i].ellipse.y_px_q16 = (int32_t)lround(y * 65536);
        list[i].level_q30 = (int32_t)lround(level * 1073741824);
    }
    /* Every circle twice, so that each colour has as many as the second order wants. */
    static struct mark twice[2 * CIRCLES];
    static uint32_t both[2 * CIRCLES];
    for (unsigned i = 0; i < 2 * CIRCLES; i++) {
        twice[i] = list[i % CIRCLES];
        both[i] = i;
    }
    cell[1] = 2 * CIRCLES;
    marks.at = twice;
    marks.count = marks.size = 2 * CIRCLES;
    marks.by_cell = both;
    light_find(&light, &patch, &marks);
    TEST_ASSERT_TRUE(patch.light.swing_q30 > 0);
    for (unsigned i = 0; i < CIRCLES; i++) {
        const double dx = list[i].ellipse.x_px_q16 / 65536.0 - 470;
        const double dy = list[i].ellipse.y_px_q16 / 65536.0 - 360;
        struct rim_view view = {.ellipse = list[i].ellipse, .contrast_q30 = 1 << 27};
        light_tilt(&patch.light, true, &view);
        SYNTH_NEAR(2e-7, 1e-4 + 6e-6 * dx - 2e-6 * dy, (double)view.level_slope_q30[0] / 1073741824.0);
        SYNTH_NEAR(2e-7, -2e-6 * dx, (double)view.level_slope_q30[1] / 1073741824.0);
        light_tilt(&patch.light, false, &view);
        SYNTH_NEAR(2e-7, 2e-6 * dx, (double)view.level_slope_q30[0] / 1073741824.0);
        SYNTH_NEAR(2e-7, -2e-4 - 8e-6 * dy, (double)view.level_slope_q30[1] / 1073741824.0);
    }
}

static void unknown_light_is_even(void)
{
    const struct patch_light unknown = {0};
    struct rim_view view = {.contrast_q30 = 1 << 27, .contrast_slope_q30 = {7, 7}};
    light_tilt(&unknown, true, &view);
    TEST_ASSERT_EQUAL_INT(0, view.level_slope_q30[0]);
    TEST_ASSERT_EQUAL_INT(0, view.contrast_slope_q30[1]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(slopes_of_black_and_white_are_found_apart);
    RUN_TEST(few_circles_say_nothing);
    RUN_TEST(level_and_contrast_tilt_by_colour);
    RUN_TEST(slopes_follow_light_that_bends);
    RUN_TEST(unknown_light_is_even);
    RUN_TEST(circles_that_something_hides_do_not_tilt_the_planes);
    return UNITY_END();
}
