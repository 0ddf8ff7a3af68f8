/* A frame made to be slow costs at most four times what a frame full of target costs. */
#include "tests/fuzz/fuzz_frame.c"

#include <stdio.h>
#include <time.h>
#include <unity.h>

#define WIDTH  640u
#define HEIGHT 480u
#define SIDE   64.0 /* px a patch: 70 patches, circles from 3.3 px */

/* The best of a few runs of processor time: what else the machine does only adds to it. The sanitizers' own
 * cost is not ours to bound; there one run shows that the frames do no harm. */
#if defined(__SANITIZE_ADDRESS__)
enum { RUNS = 1 };
#else
enum { RUNS = 4 };
#endif

static uint8_t pixels[WIDTH * HEIGHT];
static struct picture picture = {WIDTH, HEIGHT, pixels};
static struct pipeline pipeline;
static struct target target;

void setUp(void) {}
void tearDown(void) {}

static double seconds(unsigned kernel_radius_px, unsigned levels)
{
    struct pipeline_settings settings = pipeline_defaults();
    settings.kernel_radius_px = (uint8_t)kernel_radius_px;
    settings.patches.levels = (uint8_t)levels;
    settings.patches.target = levels == 2 ? &target : NULL;
    const struct frame_view frame = {.pixels = pixels, .stride_bytes = WIDTH, .width_px = WIDTH,
                                     .height_px = HEIGHT, .format = FRAME_GREY8};
    const size_t size = pipeline_bytes(WIDTH, HEIGHT);
    void *memory = malloc(size);
    TEST_ASSERT_NOT_NULL(memory);
    pipeline_init(&pipeline, memory, size, WIDTH, HEIGHT, &settings);
    clock_t best = 0;
    for (unsigned run = 0; run < RUNS; run++) {
        const clock_t start = clock();
        pipeline_run(&pipeline, &frame);
        const clock_t spent = clock() - start;
        best = run == 0 || spent < best ? spent : best;
    }
    free(memory);
    return (double)best / CLOCKS_PER_SEC;
}

/* Patches of the target over the whole frame, each with an id of its own. */
static double full_target(void)
{
    memset(&target, 0, sizeof target);
    target.rows = 8;
    target.cols = 10;
    target.levels = 2;
    target.circle_ratio_q16 = 32768;
    target.edge_level_q16 = 52429;
    target.gauss_sigma_q16 = 26214;
    target.patch_nm = 100000000;
    for (unsigned i = 0; i < 80; i++) {
        target.ids[i] = (uint16_t)(11 + 51 * i);
    }
    unsigned bad;
    TEST_ASSERT_EQUAL_INT(TARGET_OK, target_prepare(&target, &bad));
    for (unsigned y = 0; y < HEIGHT; y++) {
        for (unsigned x = 0; x < WIDTH; x++) {
            double sum = 0;
            for (unsigned k = 0; k < 9; k++) {
                const double u = (x + 0.5 * (k % 3)) / SIDE;
                const double v = (y + 0.5 * (k / 3)) / SIDE;
                const unsigned col = (unsigned)u;
                const unsigned row = (unsigned)v;
                sum += reflectance(2, target.ids[row * 10 + (col < 9 ? col : 9)], u - floor(u),
                                   v - floor(v));
            }
            pixels[y * WIDTH + x] = (uint8_t)(30 + 190 * sum / 9);
        }
    }
    const double normal = seconds(3, 2);
    TEST_ASSERT_TRUE(pipeline.patches.count >= 60);
    return normal;
}

static void check(const char *what, double normal, double spent)
{
    if (getenv("TESSERA_SHOW_COST") != NULL) {
        printf("%-32s %5.1f ms, %.2f of a full target's\n", what, 1e3 * spent, spent / normal);
    }
    if (RUNS > 1 && spent > 4 * normal) {
        static char text[120];
        snprintf(text, sizeof text, "%s: %.1f ms against %.1f ms", what, 1e3 * spent, 1e3 * normal);
        TEST_FAIL_MESSAGE(text);
    }
}

static void patterns_cost_at_most_four_full_targets(void)
{
    static const struct {
        const char *name;
        unsigned    kind;
        uint8_t     parameter;
    } patterns[] = {
        {"noise", FUZZ_FRAME_NOISE, 0},          {"salt", FUZZ_FRAME_SALT, 0},
        {"sparse salt", FUZZ_FRAME_SALT, 8},     {"checks of 1 px", FUZZ_FRAME_CHECKER, 0},
        {"checks of 2 px", FUZZ_FRAME_CHECKER, 1}, {"checks of 3 px", FUZZ_FRAME_CHECKER, 2},
        {"checks of 4 px", FUZZ_FRAME_CHECKER, 3}, {"columns of 2 px", FUZZ_FRAME_STRIPES, 33},
        {"rows of 2 px", FUZZ_FRAME_STRIPES, 65},  {"slanting stripes", FUZZ_FRAME_STRIPES, 2},
        {"discs, 5 px apart", FUZZ_FRAME_CIRCLES, 3}, {"discs, 7 px apart", FUZZ_FRAME_CIRCLES, 5},
        {"rings, 8 px apart", FUZZ_FRAME_CIRCLES, 70}, {"rings, 10 px apart", FUZZ_FRAME_CIRCLES, 73},
        {"text", FUZZ_FRAME_TEXT, 0},
    };
    const double normal = full_target();
    check("full target", normal, normal);
    for (unsigned i = 0; i < sizeof patterns / sizeof patterns[0]; i++) {
        struct content content = {NULL, 0, 9, patterns[i].parameter};
        draw(&picture, patterns[i].kind, 2, &content);
        check(patterns[i].name, normal, seconds(3, 2));
    }
}

static void darken(double x0, double y0, double major, double minor, double angle)
{
    for (int y = (int)(y0 - major - 2); y <= y0 + major + 2; y++) {
        for (int x = (int)(x0 - major - 2); x <= x0 + major + 2; x++) {
            if (x < 0 || y < 0 || x >= (int)WIDTH || y >= (int)HEIGHT) {
                continue;
            }
            const double p = cos(angle) * (x - x0) + sin(angle) * (y - y0);
            const double q = cos(angle) * (y - y0) - sin(angle) * (x - x0);
            const double in = fmin(1, (1 - hypot(p / major, q / minor)) * minor + 0.5);
            uint8_t *at = &pixels[(unsigned)y * WIDTH + (unsigned)x];
            *at = in > 0 && 200 - 180 * in < *at ? (uint8_t)(200 - 180 * in) : *at;
        }
    }
}

/* Long ellipses that pass for anchors among dots that pass for their patches' circles: every anchor looks far, at
 * many, in vain. The worst of some hundred such frames drawn at random. */
static void false_anchors_among_dots_cost_at_most_four_full_targets(void)
{
    static const struct {
        double   dots, dot, major, minor, across, down;
        unsigned kernel, levels;
    } frames[] = {{5.6, 1.6, 5.2, 2.7, 14.7, 30.9, 2, 2},
                  {5.5, 1.9, 9.7, 3.6, 36.3, 14.6, 3, 3},
                  {6.6, 2.8, 10.3, 4.6, 39.0, 18.2, 2, 2},
                  {7.2, 2.6, 11.2, 3.3, 36.7, 33.9, 3, 2}};
    const double normal = full_target();
    for (unsigned i = 0; i < 4; i++) {
        memset(pixels, 200, sizeof pixels);
        for (double y = frames[i].dots / 2; y < HEIGHT; y += frames[i].dots) {
            for (double x = frames[i].dots / 2; x < WIDTH; x += frames[i].dots) {
                const double dx = fmod(x, frames[i].across) - frames[i].across / 2;
                const double dy = fmod(y, frames[i].down) - frames[i].down / 2;
                if (hypot(dx / frames[i].major, dy / frames[i].minor) > 1.6) {
                    darken(x, y, frames[i].dot, frames[i].dot, 0);
                }
            }
        }
        for (double y = frames[i].down / 2; y < HEIGHT; y += frames[i].down) {
            for (double x = frames[i].across / 2; x < WIDTH; x += frames[i].across) {
                darken(x, y, frames[i].major, frames[i].minor, 0);
            }
        }
        const double spent = seconds(frames[i].kernel, frames[i].levels);
        TEST_ASSERT_TRUE(pipeline.marks.count > 1000);
        check("false anchors", normal, spent);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(patterns_cost_at_most_four_full_targets);
    RUN_TEST(false_anchors_among_dots_cost_at_most_four_full_targets);
    return UNITY_END();
}
