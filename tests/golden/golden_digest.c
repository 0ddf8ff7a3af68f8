/* Prints, for each golden frame, what every processor and every variant of the row kernels must agree on:
 *
 *   golden_digest [--dsp NAME | --repeat N] FRAME.pgm...    ->    FRAME DIGEST FEATURES
 *
 * Without --dsp each variant of this processor runs, and all must agree. --repeat counts instructions:
 * the difference between N and N + 1 is one frame. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware/app/dsp_choice.h"
#include "tests/golden/golden_run.h"

#define FILE_BYTES_MAX (2u * GOLDEN_WIDTH_MAX * GOLDEN_HEIGHT_MAX + 64u)

static bool read_frame(const char *path, struct frame_view *frame)
{
    static uint8_t bytes[FILE_BYTES_MAX];
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        return false;
    }
    const size_t size = fread(bytes, 1, sizeof bytes, file);
    (void)fclose(file);
    return golden_parse(bytes, size, frame);
}

static bool digest_frame(const char *path, const char *dsp, int repeat)
{
    struct frame_view frame;
    struct golden_result first = {0};
    if (!read_frame(path, &frame)) {
        (void)fprintf(stderr, "golden_digest: %s: no golden frame\n", path);
        return false;
    }
    for (unsigned i = 0; dsp_choice_at(i) != NULL; i++) {
        const struct dsp_kernels *kernels = dsp_choice_find(dsp == NULL ? dsp_choice_at(i)->name : dsp);
        struct golden_result result;
        for (int k = 0; k < repeat; k++) {
            if (kernels == NULL || !golden_run(&frame, kernels, &result)) {
                (void)fprintf(stderr, "golden_digest: %s could not be detected\n", path);
                return false;
            }
        }
        if (i > 0 && result.digest != first.digest) {
            (void)fprintf(stderr, "golden_digest: %s: %s differs from %s\n", path, kernels->name,
                          dsp_choice_at(0)->name);
            return false;
        }
        first = result;
        if (dsp != NULL) {
            break;
        }
    }
    const char *name = strrchr(path, '/');
    (void)printf("%s %016llx %u\n", name == NULL ? path : name + 1,
                 (unsigned long long)first.digest, first.features);
    return true;
}

int main(int argc, char **argv)
{
    const char *dsp = NULL;
    int repeat = 1;
    int at = 1;
    for (; at + 1 < argc && argv[at][0] == '-'; at += 2) {
        if (strcmp(argv[at], "--dsp") == 0) {
            dsp = argv[at + 1];
        } else if (strcmp(argv[at], "--repeat") == 0) {
            repeat = atoi(argv[at + 1]);
        }
    }
    for (; at < argc; at++) {
        if (!digest_frame(argv[at], dsp, repeat)) {
            return EXIT_FAILURE;
        }
    }
    return EXIT_SUCCESS;
}
