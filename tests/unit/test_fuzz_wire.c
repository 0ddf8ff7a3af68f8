/* The fuzz target of packets over the golden samples and mutations of them, without a fuzzer. */
#include "tests/fuzz/fuzz_wire.c"

#include "unity.h"

#include <dirent.h>
#include <stdio.h>

#define GOLDEN "tests/golden/wire/"
enum { SEED_BYTES_MAX = 4096, MUTATIONS = 3000 };

void setUp(void) {}
void tearDown(void) {}

static size_t read_seed(const char *name, uint8_t *to)
{
    char path[512];
    char line[256];
    size_t count = 0;
    snprintf(path, sizeof path, GOLDEN "%s", name);
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

static uint32_t random_state = 1;

static uint32_t next_random(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 17;
    random_state ^= random_state << 5;
    return random_state;
}

/* One to four bytes changed; in half of the cases the length too, stated as it then is. */
static void run_mutation(const uint8_t *seed, size_t seed_count)
{
    static uint8_t bytes[2 * SEED_BYTES_MAX];
    memcpy(bytes, seed, seed_count);
    size_t count = seed_count;
    if (next_random() % 2 == 0) {
        count = next_random() % (seed_count + 32);
        for (size_t i = seed_count; i < count; i++) {
            bytes[i] = (uint8_t)(next_random() & 0xff);
        }
    }
    for (uint32_t left = 1 + next_random() % 4; left > 0 && count > 0; left--) {
        bytes[next_random() % count] = (uint8_t)(next_random() & 0xff);
    }
    if (count >= WIRE_PREFIX_BYTES) {
        (void)bytes_put_u32(bytes + 8, (uint32_t)count);
    }
    run_exact(bytes, count);
}

static void no_mutation_of_a_sample_breaks_the_decoder(void)
{
    static uint8_t seed[SEED_BYTES_MAX];
    DIR *folder = opendir(GOLDEN);
    TEST_ASSERT_NOT_NULL(folder);
    int seeds = 0;
    const struct dirent *entry;
    while ((entry = readdir(folder)) != NULL) {
        const char *dot = strrchr(entry->d_name, '.');
        if (dot == NULL || strcmp(dot, ".hex") != 0) {
            continue;
        }
        const size_t count = read_seed(entry->d_name, seed);
        run_exact(seed, count);
        for (int i = 0; i < MUTATIONS; i++) {
            run_mutation(seed, count);
        }
        seeds++;
    }
    closedir(folder);
    TEST_ASSERT_TRUE(seeds > 50);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(no_mutation_of_a_sample_breaks_the_decoder);
    return UNITY_END();
}
