/* Numbers from text, checked, into the units of the pipeline. */
#include "firmware/app/detector_options.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "firmware/app/dsp_choice.h"

void detector_options_init(struct detector_options *options)
{
    options->settings = pipeline_defaults();
    options->settings.dsp = dsp_choice_find("best");
    options->has_target = false;
}

static bool read_number(const char *text, double low, double high, double *number)
{
    char *end;
    *number = strtod(text, &end);
    return end != text && *end == '\0' && *number >= low && *number <= high;
}

bool detector_options_take(struct detector_options *options, int option, const char *value,
                           bool *usage, char error[TARGETFILE_ERROR_BYTES])
{
    struct pipeline_settings *settings = &options->settings;
    double number = 0;
    *usage = true;
    switch (option) {
    case DETECTOR_OPTION_TARGET:
        *usage = false;
        options->has_target = targetfile_read(value, &options->target, error);
        return options->has_target;
    case DETECTOR_OPTION_KERNEL:
        if (!read_number(value, 5, 11, &number) || fmod(number, 2) != 1) {
            (void)snprintf(error, TARGETFILE_ERROR_BYTES,
                           "--kernel %s: the sizes are 5, 7, 9 and 11", value);
            return false;
        }
        settings->kernel_radius_px = (uint8_t)((number - 1) / 2);
        return true;
    case DETECTOR_OPTION_GRADIENT:
        if (!read_number(value, 0.5, 100, &number)) {
            (void)snprintf(error, TARGETFILE_ERROR_BYTES,
                           "--gradient-min %s: give grey levels a pixel, from 0.5 to 100", value);
            return false;
        }
        settings->gradient_min_q3 = (uint32_t)lround(number * 128);
        return true;
    case DETECTOR_OPTION_LEVELS:
        if (!read_number(value, 2, 3, &number) || number != floor(number)) {
            (void)snprintf(error, TARGETFILE_ERROR_BYTES, "--levels %s: 2 or 3 can be detected",
                           value);
            return false;
        }
        settings->patches.levels = (uint8_t)number;
        return true;
    case DETECTOR_OPTION_CIRCLE_RATIO:
        if (!read_number(value, 0.05, 1, &number)) {
            (void)snprintf(error, TARGETFILE_ERROR_BYTES, "--circle-ratio %s: give 0.05 to 1",
                           value);
            return false;
        }
        settings->patches.circle_ratio_q16 = (uint32_t)lround(number * 65536);
        return true;
    case DETECTOR_OPTION_DSP:
        settings->dsp = dsp_choice_find(value);
        if (settings->dsp == NULL) {
            (void)snprintf(error, TARGETFILE_ERROR_BYTES,
                           "--dsp %s: this machine runs best, %s", value, dsp_choice_names());
            return false;
        }
        return true;
    default:
        (void)snprintf(error, TARGETFILE_ERROR_BYTES, "no such option");
        return false;
    }
}

const struct pipeline_settings *detector_options_settings(struct detector_options *options)
{
    if (options->has_target) {
        struct patches_settings *patches = &options->settings.patches;
        patches->target = &options->target.target;
        patches->levels = options->target.target.levels;
        patches->circle_ratio_q16 = options->target.target.circle_ratio_q16;
        patches->edge_level_q16 = options->target.target.edge_level_q16;
        patches->gauss_sigma_q16 = options->target.target.gauss_sigma_q16;
    }
    return &options->settings;
}
