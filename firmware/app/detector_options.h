/* The detector's settings on a command line: the same words for every program that detects. */
#ifndef TESSERA_FIRMWARE_APP_DETECTOR_OPTIONS_H
#define TESSERA_FIRMWARE_APP_DETECTOR_OPTIONS_H

#include <getopt.h>
#include <stdbool.h>

#include "common/targetfile/targetfile.h"
#include "firmware/app/pipeline.h"

/* Values for `val` in struct option, above all characters. */
enum {
    DETECTOR_OPTION_TARGET = 1000,
    DETECTOR_OPTION_KERNEL,
    DETECTOR_OPTION_GRADIENT,
    DETECTOR_OPTION_LEVELS,
    DETECTOR_OPTION_CIRCLE_RATIO,
    DETECTOR_OPTION_DSP,
};

#define DETECTOR_OPTIONS                                                                           \
    {"target", required_argument, NULL, DETECTOR_OPTION_TARGET},                                   \
        {"kernel", required_argument, NULL, DETECTOR_OPTION_KERNEL},                               \
        {"gradient-min", required_argument, NULL, DETECTOR_OPTION_GRADIENT},                       \
        {"levels", required_argument, NULL, DETECTOR_OPTION_LEVELS},                               \
        {"circle-ratio", required_argument, NULL, DETECTOR_OPTION_CIRCLE_RATIO},                       \
        {"dsp", required_argument, NULL, DETECTOR_OPTION_DSP}

#define DETECTOR_OPTIONS_HELP                                                                      \
    "  --target FILE        target file; without it ids are decoded and not checked\n"             \
    "  --kernel N           filter size in pixels: 5, 7, 9 or 11 (default 7)\n"                    \
    "  --gradient-min G     weakest edge, grey levels (of 256) a pixel, 0.5 to 100 (default 2.5)\n" \
    "  --levels N           levels of the target, 2 or 3, where no file says so (default 2)\n"     \
    "  --circle-ratio R     circle over incircle radius, 0.05 to 1, where no file says so\n"       \
    "                       (default 0.5)\n"                                                       \
    "  --dsp NAME           row kernels: best, avx2, sse2, neon or scalar, as the processor has;\n"    \
    "                       all give the same result (default best)\n"

struct detector_options {
    struct pipeline_settings settings;
    struct targetfile        target;      /* read when has_target */
    bool                     has_target;
};

void detector_options_init(struct detector_options *options);

/* Takes one option. False with a sentence when its value is no good; *usage then says whether the
 * command line (true) or a file (false) is at fault. */
bool detector_options_take(struct detector_options *options, int option, const char *value,
                           bool *usage, char error[TARGETFILE_ERROR_BYTES]);

/* The settings; they point into *options. */
const struct pipeline_settings *detector_options_settings(struct detector_options *options);

#endif
