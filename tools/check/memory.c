/* Prints the memory that the detector asks for at the sizes that have a limit; fails above one. */
#include <stdio.h>
#include <stdlib.h>

#include "firmware/app/pipeline.h"

static const struct {
    uint16_t width_px;
    uint16_t height_px;
    size_t   limit_bytes;
} sizes[] = {
    {1920, 1080, 4u << 20},
    {4096, 3000, 24u << 20},
};

int main(void)
{
    int exit_code = EXIT_SUCCESS;
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        const size_t bytes = pipeline_bytes(sizes[i].width_px, sizes[i].height_px) +
                             sizeof(struct pipeline);
        (void)printf("memory: %ux%u needs %zu bytes, limit %zu\n", sizes[i].width_px,
                     sizes[i].height_px, bytes, sizes[i].limit_bytes);
        if (bytes > sizes[i].limit_bytes) {
            exit_code = EXIT_FAILURE;
        }
    }
    return exit_code;
}
