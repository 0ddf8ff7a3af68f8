/* A frame made to be slow costs at most four times what a frame full of target costs: in short, by time; `make
 * worst-frames` counts instructions at full size. */
#include "tests/cost/hard_frames.c"

#include <stdio.h>
#include <time.h>
#include <unity.h>

#include "firmware/app/dsp_choice.h"

/* The best of a few runs of processor time: what else the machine does only adds to it. The sanitizers' own
 * cost is not ours to bound; there one run of small frames shows that they do no harm. */
#if defined(__SANITIZE_ADDRESS__)
enum { RUNS = 1, PARTS = 2 };
#else
enum { RUNS = 3, PARTS = 1 };
#endif
enum { WIDTH = 640, HEIGHT = 480 };

static uint8_t grey[WIDTH * HEIGHT];
static struct pipeline pipeline;

void setUp(void) {}
void tearDown(void) {}

/* On a frame of a part of the width and height. */
static double seconds(unsigned index, unsigned part)
{
    const uint16_t width = (uint16_t)(WIDTH / part);
    const uint16_t height = (uint16_t)(HEIGHT / part);
    struct pipeline_settings settings;
    hard_frames_draw(index, width, height, grey);
    hard_frames_set(index, width, height, &settings);
    settings.dsp = dsp_choice_at(0);
    const struct frame_view frame = {.pixels = grey, .stride_bytes = width, .width_px = width,
                                     .height_px = height, .format = FRAME_GREY8};
    const size_t size = pipeline_bytes(width, height);
    void *memory = malloc(size);
    TEST_ASSERT_NOT_NULL(memory);
    pipeline_init(&pipeline, memory, size, width, height, &settings);
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

static unsigned find(const char *name)
{
    unsigned index = 0;
    while (hard_frames_name(index) != NULL && strcmp(hard_frames_name(index), name) != 0) {
        index++;
    }
    TEST_ASSERT_NOT_NULL_MESSAGE(hard_frames_name(index), name);
    return index;
}

/* Normal is the busiest frame whose smallest circles have 3 px radius and more. */
static void no_frame_costs_more_than_four_full_of_target(void)
{
    const double normal = seconds(find("full target, 64 px patches"), PARTS);
    TEST_ASSERT_TRUE(pipeline.patches.count >= WIDTH * HEIGHT / 64 / 64 / PARTS / PARTS - 10);
    for (unsigned i = 0; hard_frames_name(i) != NULL; i++) {
        const double spent = seconds(i, PARTS);
        if (getenv("TESSERA_SHOW_COST") != NULL) {
            printf("%-36s %5.1f ms, %.2f of a full target's\n", hard_frames_name(i), 1e3 * spent,
                   spent / normal);
        }
        if (RUNS > 1 && spent > 4 * normal) {
            static char text[120];
            snprintf(text, sizeof text, "%s: %.1f ms against %.1f ms", hard_frames_name(i),
                     1e3 * spent, 1e3 * normal);
            TEST_FAIL_MESSAGE(text);
        }
    }
}

/* What makes frames slow without end is left out, and the packet says so. */
static void frames_full_of_edges_or_shapes_say_that_some_were_left_out(void)
{
    (void)seconds(find("noise"), 1);
    TEST_ASSERT_TRUE((pipeline_truncated(&pipeline) & WIRE_TRUNCATED_EDGES) != 0);
    (void)seconds(find("checks of 3 px"), 1);
    TEST_ASSERT_TRUE((pipeline_truncated(&pipeline) & WIRE_TRUNCATED_EDGES) != 0);
    (void)seconds(find("triangles of 8 px"), 1);
    TEST_ASSERT_TRUE((pipeline_truncated(&pipeline) & WIRE_TRUNCATED_ELLIPSES) != 0);
    (void)seconds(find("discs, 5 px apart"), 1);
    TEST_ASSERT_TRUE((pipeline_truncated(&pipeline) & WIRE_TRUNCATED_ELLIPSES) != 0);
    (void)seconds(find("full target, 64 px patches"), 1);
    TEST_ASSERT_EQUAL_UINT(0, pipeline_truncated(&pipeline));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(no_frame_costs_more_than_four_full_of_target);
    RUN_TEST(frames_full_of_edges_or_shapes_say_that_some_were_left_out);
    return UNITY_END();
}
