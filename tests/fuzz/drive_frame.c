/* Runs the fuzz target of frames over made-up cases for a while:
 *
 *     drive_frame SECONDS FOLDER [FIRST]
 *
 * Each case lies in FOLDER/frame_case.hex while it runs, so that one that ends the program is kept. */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "tests/fuzz/fuzz_frame.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t count);

static void keep_case(const char *path, unsigned long number, const uint8_t *bytes, size_t count)
{
    FILE *file = fopen(path, "w");
    if (file == NULL) {
        perror(path);
        exit(1);
    }
    fprintf(file, "# case %lu\n", number);
    for (size_t i = 0; i < count; i++) {
        fprintf(file, "%02x%c", bytes[i], i % 16 == 15 || i + 1 == count ? '\n' : ' ');
    }
    fclose(file);
}

int main(int argc, char **argv)
{
    if (argc < 3) {
        fprintf(stderr, "usage: drive_frame SECONDS FOLDER [FIRST]\n");
        return 2;
    }
    const time_t end = time(NULL) + atol(argv[1]);
    const unsigned long first = argc > 3 ? strtoul(argv[3], NULL, 10) : (unsigned long)time(NULL) << 20;
    char path[512];
    snprintf(path, sizeof path, "%s/frame_case.hex", argv[2]);
    unsigned long number = first;
    for (; time(NULL) < end; number++) {
        /* On the heap and of just the size, so that the sanitizers see any read beyond it. */
        uint8_t all[FUZZ_FRAME_CASE_BYTES];
        const size_t count = fuzz_frame_case(number, all);
        uint8_t *bytes = malloc(count);
        if (bytes == NULL) {
            return 1;
        }
        for (size_t i = 0; i < count; i++) {
            bytes[i] = all[i];
        }
        keep_case(path, number, bytes, count);
        LLVMFuzzerTestOneInput(bytes, count);
        free(bytes);
    }
    remove(path);
    printf("frames: cases %lu to %lu passed\n", first, number - 1);
    return 0;
}
