/* Runs a fuzz target over its kept inputs, without a fuzzer:
 *
 *     replay_NAME        from the tree's top; the inputs are the lines of tests/fuzz/corpus/NAME.hex
 *
 * TESSERA_SHOW_INPUTS tells each input before it runs, so that one that ends the program is known. */
#include <ctype.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "tests/fuzz/fuzz_input.h"

#define INPUT_BYTES_MAX 65536u

static char corpus_path[512];

void setUp(void) {}
void tearDown(void) {}

/* The next line's bytes; lines that begin with # are skipped. False after the last. */
static bool next_input(FILE *file, uint8_t bytes[INPUT_BYTES_MAX], size_t *count)
{
    static char line[2 * INPUT_BYTES_MAX + 2];
    do {
        if (fgets(line, sizeof line, file) == NULL) {
            return false;
        }
    } while (line[0] == '#');
    *count = 0;
    for (const char *at = line; isxdigit(at[0]) && isxdigit(at[1]); at += 2) {
        const char digits[3] = {at[0], at[1], '\0'};
        bytes[(*count)++] = (uint8_t)strtoul(digits, NULL, 16);
    }
    return true;
}

/* A copy of just the size, so that the sanitizers see any read beyond it. */
static void run_exact(const uint8_t *bytes, size_t count)
{
    uint8_t *exact = malloc(count > 0 ? count : 1);
    TEST_ASSERT_NOT_NULL(exact);
    memcpy(exact, bytes, count);
    (void)LLVMFuzzerTestOneInput(exact, count);
    free(exact);
}

static void kept_inputs_run_through(void)
{
    static uint8_t bytes[INPUT_BYTES_MAX];
    FILE *file = fopen(corpus_path, "r");
    TEST_ASSERT_NOT_NULL_MESSAGE(file, corpus_path);
    size_t count;
    unsigned inputs = 0;
    while (next_input(file, bytes, &count)) {
        if (getenv("TESSERA_SHOW_INPUTS") != NULL) {
            (void)fprintf(stderr, "%s: input %u, %zu bytes\n", corpus_path, inputs, count);
        }
        run_exact(bytes, count);
        inputs++;
    }
    (void)fclose(file);
    TEST_ASSERT_TRUE_MESSAGE(inputs >= 10, "hardly any inputs were kept");
}

int main(int argc, char **argv)
{
    (void)argc;
    const char *name = strrchr(argv[0], '/');
    name = name != NULL ? name + 1 : argv[0];
    if (strncmp(name, "replay_", 7) != 0) {
        (void)fprintf(stderr, "replay_main: must be called replay_NAME\n");
        return 2;
    }
    (void)snprintf(corpus_path, sizeof corpus_path, "tests/fuzz/corpus/%s.hex", name + 7);
    UNITY_BEGIN();
    RUN_TEST(kept_inputs_run_through);
    return UNITY_END();
}
