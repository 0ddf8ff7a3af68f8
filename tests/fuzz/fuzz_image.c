/* Any bytes as an image file: refused with a sentence that names it, or pixels that all can be read. */
#include <string.h>

#include "firmware/app/image_file.h"
#include "firmware/limits.h"
#include "tests/fuzz/fuzz_input.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t count)
{
    const char *path = fuzz_file(data, count);
    struct image_file image;
    char error[IMAGE_FILE_ERROR_BYTES] = "";
    if (!image_file_read(path, &image, error)) {
        fuzz_require(strncmp(error, path, strlen(path)) == 0 && strlen(error) > strlen(path) + 2);
        fuzz_require(image.pixels == NULL);
        return 0;
    }
    const struct frame_view *frame = &image.frame;
    fuzz_require(frame->width_px >= 1 && frame->width_px <= LIMIT_SIDE_PX);
    fuzz_require(frame->height_px >= 1 && frame->height_px <= LIMIT_SIDE_PX);
    fuzz_require(frame->stride_bytes >= frame_row_bytes(frame->format, frame->width_px));
    volatile uint8_t sum = 0; /* the sanitizers see whether all of it is there */
    for (size_t y = 0; y < frame->height_px; y++) {
        for (size_t x = 0; x < frame_row_bytes(frame->format, frame->width_px); x++) {
            sum = (uint8_t)(sum + frame->pixels[y * frame->stride_bytes + x]);
        }
    }
    image_file_free(&image);
    return 0;
}
