/* Runs the detector on one frame so many times, and does nothing else worth counting: the difference between
 * N and N + 1 runs under a counting emulator is one frame.
 *
 *   count_frame DSP TARGET.json FRAME.pgm N */
#include <stdio.h>
#include <stdlib.h>

#include "common/targetfile/targetfile.h"
#include "firmware/app/dsp_choice.h"
#include "firmware/app/image_file.h"
#include "firmware/app/pipeline.h"

static_assert(TARGETFILE_ERROR_BYTES <= IMAGE_FILE_ERROR_BYTES, "one buffer for both errors");

int main(int argc, char **argv)
{
    static struct pipeline pipeline;
    static struct targetfile target;
    struct image_file image;
    char error[IMAGE_FILE_ERROR_BYTES] = "usage: count_frame DSP TARGET.json FRAME.pgm N";
    struct pipeline_settings settings = pipeline_defaults();
    if (argc != 5 || !targetfile_read(argv[2], &target, error) ||
        !image_file_read(argv[3], &image, error)) {
        (void)fprintf(stderr, "count_frame: %s\n", error);
        return EXIT_FAILURE;
    }
    settings.dsp = dsp_choice_find(argv[1]);
    settings.patches.target = &target.target;
    const size_t bytes = pipeline_bytes(image.frame.width_px, image.frame.height_px);
    void *memory = malloc(bytes);
    if (settings.dsp == NULL || memory == NULL) {
        (void)fprintf(stderr, "count_frame: no such kernels, or no memory\n");
        return EXIT_FAILURE;
    }
    pipeline_init(&pipeline, memory, bytes, image.frame.width_px, image.frame.height_px, &settings);
    for (int i = 0; i < atoi(argv[4]); i++) {
        pipeline_run(&pipeline, &image.frame);
    }
    (void)printf("%u\n", image.frame.width_px * (unsigned)image.frame.height_px);
    free(memory);
    image_file_free(&image);
    return EXIT_SUCCESS;
}
