/* The fuzz target of frames over the committed cases and some made-up ones, without a fuzzer. */
#include "tests/fuzz/fuzz_frame.c"

#include <dirent.h>
#include <stdio.h>
#include <unity.h>

#define FRAMES "tests/fuzz/frames/"
enum { SEED_BYTES_MAX = 4096, CASES = 300 };

void setUp(void) {}
void tearDown(void) {}

static size_t read_seed(const char *name, uint8_t *to)
{
    char path[512];
    char line[256];
    size_t count = 0;
    snprintf(path, sizeof path, FRAMES "%s", name);
    FILE *file = fopen(path, "r");
    TEST_ASSERT_NOT_NULL_MESSAGE(file, path);
    while (fgets(line, sizeof line, file) != NULL) {
        unsigned byte;
        int used;
        for (const char *at = line; sscanf(at, "%2x%n", &byte, &used) == 1; at += used) {
            TEST_ASSERT_TRUE(count < SEED_BYTES_MAX);
            to[count++] = (uint8_t)byte;
        }
    }
    fclose(file);
    return count;
}

/* A copy of just the size, so that the sanitizers see any read beyond it. */
static void run_exact(const uint8_t *bytes, size_t count)
{
    uint8_t *exact = malloc(count > 0 ? count : 1);
    TEST_ASSERT_NOT_NULL(exact);
    memcpy(exact, bytes, count);
    LLVMFuzzerTestOneInput(exact, count);
    free(exact);
}

static void frames_that_once_broke_the_detector_run_through(void)
{
    static uint8_t seed[SEED_BYTES_MAX];
    DIR *folder = opendir(FRAMES);
    TEST_ASSERT_NOT_NULL(folder);
    int seeds = 0;
    const struct dirent *entry;
    while ((entry = readdir(folder)) != NULL) {
        const char *dot = strrchr(entry->d_name, '.');
        if (dot != NULL && strcmp(dot, ".hex") == 0) {
            run_exact(seed, read_seed(entry->d_name, seed));
            seeds++;
        }
    }
    closedir(folder);
    TEST_ASSERT_TRUE(seeds >= 2);
}

static void frames_at_random_run_through(void)
{
    uint8_t bytes[FUZZ_FRAME_CASE_BYTES];
    for (uint64_t number = 0; number < CASES; number++) {
        run_exact(bytes, fuzz_frame_case(number, bytes));
    }
}

/* So that the cases reach every stage: of those that show a target some must be read, some completed. */
static void cases_show_targets_that_are_read(void)
{
    uint8_t bytes[FUZZ_FRAME_CASE_BYTES];
    unsigned read = 0;
    unsigned completed = 0;
    for (uint64_t number = 1; number <= 2 * CASES; number++) { /* a quarter of them show one */
        const size_t count = fuzz_frame_case(number, bytes);
        if (fuzz_frame_read_head(bytes).kind == FUZZ_FRAME_TARGET) {
            bytes[9] = 6; /* two levels, with the drawn target */
            fuzz_frame_seen = (struct fuzz_frame_seen){0};
            run_exact(bytes, count);
            read += fuzz_frame_seen.patches > 0;
            completed += fuzz_frame_seen.added > 0;
        }
    }
    TEST_ASSERT_TRUE(read >= 5);
    TEST_ASSERT_TRUE(completed >= 2);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(frames_that_once_broke_the_detector_run_through);
    RUN_TEST(frames_at_random_run_through);
    RUN_TEST(cases_show_targets_that_are_read);
    return UNITY_END();
}
