/* What the fuzz targets of parsers share: a demand, and bytes as a file. C11 and C++17. */
#ifndef TESSERA_TESTS_FUZZ_FUZZ_INPUT_H
#define TESSERA_TESTS_FUZZ_FUZZ_INPUT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The entry that libFuzzer and replay_main.c call. Always 0; what must not be ends the program. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t count);

static inline void fuzz_require(bool holds)
{
    if (!holds) {
        abort();
    }
}

/* The path of a file in memory that holds these bytes, until the next call. */
static inline const char *fuzz_file(const uint8_t *data, size_t count)
{
    static int fd = -1;
    static char path[64];
    if (fd < 0) {
        fd = memfd_create("fuzz", MFD_CLOEXEC);
        (void)snprintf(path, sizeof path, "/proc/self/fd/%d", fd);
    }
    fuzz_require(ftruncate(fd, 0) == 0 && pwrite(fd, data, count, 0) == (ssize_t)count);
    return path;
}

#ifdef __cplusplus
}
#endif

#endif
