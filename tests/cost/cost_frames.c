/* The detector's cost on frames made to be slow:
 *
 *     cost_frames names                                   INDEX NORMAL NAME, one line a frame
 *     cost_frames draw WIDTH HEIGHT INDEX > PIXELS        a frame's bytes
 *     cost_frames run WIDTH HEIGHT INDEX < PIXELS         detects in it once, to be counted (worst_frames.py)
 *     cost_frames time WIDTH HEIGHT [INDEX]               processor time of one or all and the stages' shares
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "firmware/app/dsp_choice.h"
#include "tests/cost/hard_frames.h"

static struct pipeline pipeline;

static uint64_t processor_ns(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

/* Detects in the pixels so often; the best time. The stages' times are the last run's. */
static double run_ms(unsigned index, unsigned width, unsigned height, const uint8_t *grey, unsigned runs)
{
    struct pipeline_settings settings;
    const size_t size = pipeline_bytes((uint16_t)width, (uint16_t)height);
    void *memory = malloc(size);
    if (memory == NULL) {
        exit(EXIT_FAILURE);
    }
    hard_frames_set(index, width, height, &settings);
    settings.dsp = dsp_choice_at(0);
    pipeline_init(&pipeline, memory, size, (uint16_t)width, (uint16_t)height, &settings);
    pipeline.clock = runs > 1 ? processor_ns : NULL;
    const struct frame_view frame = {.pixels = grey, .stride_bytes = width, .width_px = (uint16_t)width,
                                     .height_px = (uint16_t)height, .format = FRAME_GREY8};
    uint64_t best = UINT64_MAX;
    for (unsigned run = 0; run < runs; run++) {
        const uint64_t start = processor_ns();
        pipeline_run(&pipeline, &frame);
        const uint64_t spent = processor_ns() - start;
        best = spent < best ? spent : best;
    }
    free(memory);
    return (double)best / 1e6;
}

static void print_found(void)
{
    const struct steer *seen = pipeline.seen_in_full ? &pipeline.steer : &pipeline.half;
    (void)printf("%.3f edge points a pixel %s, %u marks, %u patches, truncated %#x\n",
                 (double)pipeline.quota.points / ((double)seen->width * seen->height),
                 pipeline.seen_in_full ? "in full" : "at half size", pipeline.marks.count,
                 pipeline.patches.count, pipeline_truncated(&pipeline));
}

static void print_time(unsigned index, unsigned width, unsigned height, uint8_t *grey)
{
    hard_frames_draw(hard_frames_normal(index), width, height, grey);
    const double normal = run_ms(hard_frames_normal(index), width, height, grey, 5);
    hard_frames_draw(index, width, height, grey);
    const double spent = run_ms(index, width, height, grey, 5);
    (void)printf("%-36s %7.1f ms %5.2f", hard_frames_name(index), spent, spent / normal);
    uint64_t sum = 1;
    for (unsigned stage = 0; stage < PIPELINE_STAGES; stage++) {
        sum += pipeline.spent[stage];
    }
    for (unsigned stage = 0; stage < PIPELINE_STAGES; stage++) {
        (void)printf(" %s %2.0f%%", pipeline_stage_name(stage),
                     100.0 * (double)pipeline.spent[stage] / (double)sum);
    }
    (void)printf("  ");
    print_found();
    (void)fflush(stdout);
}

int main(int argc, char **argv)
{
    const unsigned width = argc > 3 ? (unsigned)atoi(argv[2]) : 1;
    const unsigned height = argc > 3 ? (unsigned)atoi(argv[3]) : 1;
    const unsigned index = argc > 4 ? (unsigned)atoi(argv[4]) : 0;
    const size_t pixels = (size_t)width * height;
    uint8_t *grey = malloc(pixels);
    if (grey == NULL) {
        return EXIT_FAILURE;
    }
    int status = EXIT_SUCCESS;
    if (argc == 2 && strcmp(argv[1], "names") == 0) {
        for (unsigned i = 0; hard_frames_name(i) != NULL; i++) {
            (void)printf("%u %u %s\n", i, hard_frames_normal(i), hard_frames_name(i));
        }
    } else if ((argc == 4 || argc == 5) && strcmp(argv[1], "time") == 0) {
        for (unsigned i = index; hard_frames_name(i) != NULL && (argc == 4 || i == index); i++) {
            print_time(i, width, height, grey);
        }
    } else if (argc == 5 && strcmp(argv[1], "draw") == 0) {
        hard_frames_draw(index, width, height, grey);
        status = fwrite(grey, 1, pixels, stdout) == pixels ? EXIT_SUCCESS : EXIT_FAILURE;
    } else if (argc == 5 && strcmp(argv[1], "run") == 0 && fread(grey, 1, pixels, stdin) == pixels) {
        (void)run_ms(index, width, height, grey, 1);
        print_found();
    } else {
        (void)fprintf(stderr, "usage: cost_frames names | time W H [INDEX] | draw W H INDEX | run W H INDEX < PIXELS\n");
        status = 2;
    }
    free(grey);
    return status;
}
