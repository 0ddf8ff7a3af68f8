/* Every variant of the row kernels against the plain one, bit for bit.
 *
 * Both write into buffers full of the same junk, and all of it is compared, guard bands too. Inputs end, or
 * begin, at a page that may not be read. Widths: 1 to three of the widest vectors, and real ones. Values:
 * random within the ranges of dsp.h, and the extremes. The seed is printed; SEED in the environment
 * sets it. */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "firmware/app/dsp_choice.h"
#include "tests/simd/simd_rim.h"

#define ROWS_MAX   (2 * TAPS_RADIUS_MAX + 1)
#define WIDTH_MAX  4096u
#define ROW_BYTES  (4u * WIDTH_MAX)
#define INPUTS     (3 * ROWS_MAX)
#define GUARD      64u
#define OUTPUTS    5u

static uint64_t seed;
static uint8_t *pages[INPUTS]; /* ROW_BYTES that may be read, between two pages that may not */
static uint8_t expected[OUTPUTS][ROW_BYTES];
static uint8_t found[OUTPUTS][ROW_BYTES];

static uint64_t random_u64(void)
{
    seed ^= seed << 13;
    seed ^= seed >> 7;
    seed ^= seed << 17;
    return seed;
}

static int32_t random_within(int32_t limit)
{
    return (int32_t)(random_u64() % (2u * (uint32_t)limit + 1)) - limit;
}

static void map_inputs(void)
{
    const size_t page = (size_t)sysconf(_SC_PAGESIZE);
    const size_t apart = ROW_BYTES + page; /* alike for all: dsp.h wants a row's parts equally far apart */
    uint8_t *all =
        mmap(NULL, INPUTS * apart + page, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    for (unsigned i = 0; i < INPUTS; i++) {
        pages[i] = all + page + i * apart;
        if (all == MAP_FAILED || mprotect(pages[i], ROW_BYTES, PROT_READ | PROT_WRITE) != 0) {
            (void)printf("simd: no memory\n");
            exit(EXIT_FAILURE);
        }
    }
}

/* The i-th input of `count` 16-bit values, against the page after it or the page before it. */
static int16_t *input(unsigned i, unsigned count, bool at_end)
{
    return (int16_t *)(void *)(at_end ? pages[i] + ROW_BYTES - count * sizeof(int16_t) : pages[i]);
}

static void fill_junk(void)
{
    memset(expected, 0x5a, sizeof expected);
    memset(found, 0x5a, sizeof found);
}

static bool same(const char *kernel, const struct dsp_kernels *variant, unsigned width)
{
    if (memcmp(expected, found, sizeof expected) != 0) {
        (void)printf("simd: %s of %s differs at width %u\n", kernel, variant->name, width);
        return false;
    }
    return true;
}

static bool check_widen(const struct dsp_kernels *variant, unsigned width, bool at_end)
{
    uint8_t *bytes = at_end ? pages[0] + ROW_BYTES - width : pages[0];
    for (unsigned i = 0; i < width; i++) {
        bytes[i] = (uint8_t)random_u64();
    }
    fill_junk();
    dsp_scalar.widen(bytes, width, (uint16_t *)(void *)(expected[0] + GUARD));
    variant->widen(bytes, width, (uint16_t *)(void *)(found[0] + GUARD));
    return same("widen", variant, width);
}

static bool check_halve(const struct dsp_kernels *variant, unsigned width, unsigned kind, bool at_end)
{
    uint8_t *rows[2];
    for (unsigned k = 0; k < 2; k++) {
        rows[k] = at_end ? pages[k] + ROW_BYTES - 2 * width : pages[k];
        for (unsigned i = 0; i < 2 * width; i++) {
            rows[k][i] = (uint8_t)(kind % 4 == 3 ? 255 : random_u64());
        }
    }
    fill_junk();
    dsp_scalar.halve(rows[0], rows[1], width, (uint16_t *)(void *)(expected[0] + GUARD));
    variant->halve(rows[0], rows[1], width, (uint16_t *)(void *)(found[0] + GUARD));
    return same("halve", variant, width);
}

/* Black and white in stripes, white alone, or noise: what drives the filters to their limits. */
static void fill_luma(uint16_t *luma, unsigned count, unsigned kind)
{
    const unsigned period = 1 + (unsigned)(random_u64() % 6);
    const unsigned phase = (unsigned)(random_u64() % 12);
    for (unsigned i = 0; i < count; i++) {
        const bool white = (i + phase) / period % 2 != 0;
        luma[i] = (uint16_t)(kind % 4 == 0   ? random_u64() % 4096
                             : kind % 4 == 1 ? (white ? 4095 : 0)
                             : kind % 4 == 2 ? (random_u64() % 2 != 0 ? 4095 : 0)
                                             : 4095);
    }
}

static struct dsp_row row_in(uint8_t buffers[OUTPUTS][ROW_BYTES])
{
    return (struct dsp_row){(int16_t *)(void *)(buffers[0] + GUARD),
                            (int16_t *)(void *)(buffers[1] + GUARD),
                            (int16_t *)(void *)(buffers[2] + GUARD)};
}

static bool check_along_x(const struct dsp_kernels *variant, const struct taps *taps, unsigned width,
                          unsigned kind, bool at_end)
{
    const unsigned count = width + 2 * taps->radius;
    uint16_t *luma = (uint16_t *)input(0, count, at_end);
    fill_luma(luma, count, kind);
    fill_junk();
    const struct dsp_row reference = row_in(expected);
    const struct dsp_row own = row_in(found);
    dsp_scalar.along_x(taps, luma + taps->radius, width, &reference);
    variant->along_x(taps, luma + taps->radius, width, &own);
    return same("along_x", variant, width);
}

static struct dsp_gradient gradient_in(uint8_t buffers[OUTPUTS][ROW_BYTES])
{
    int16_t *rows[OUTPUTS];
    for (unsigned i = 0; i < OUTPUTS; i++) {
        rows[i] = (int16_t *)(void *)(buffers[i] + GUARD);
    }
    return (struct dsp_gradient){.x_q3 = rows[0], .y_q3 = rows[1], .xx_q2 = rows[2],
                                 .xy_q2 = rows[3], .yy_q2 = rows[4]};
}

static bool check_along_y(const struct dsp_kernels *variant, const struct taps *taps, unsigned width,
                          unsigned kind, bool at_end)
{
    static uint16_t luma[WIDTH_MAX + 2 * TAPS_RADIUS_MAX];
    struct dsp_row rows[ROWS_MAX];
    for (unsigned r = 0; r <= 2 * taps->radius; r++) {
        fill_luma(luma, width + 2 * taps->radius, kind);
        rows[r] = (struct dsp_row){input(3 * r, width, at_end), input(3 * r + 1, width, at_end),
                                   input(3 * r + 2, width, at_end)};
        dsp_scalar.along_x(taps, luma + taps->radius, width, &rows[r]);
    }
    fill_junk();
    const struct dsp_gradient reference = gradient_in(expected);
    const struct dsp_gradient own = gradient_in(found);
    dsp_scalar.along_y(taps, rows, width, &reference);
    variant->along_y(taps, rows, width, &own);
    return same("along_y", variant, width);
}

static struct dsp_gradient sides_in(uint8_t buffers[OUTPUTS][ROW_BYTES], int16_t *rows[5],
                                    unsigned shift)
{
    return (struct dsp_gradient){rows[0], rows[1], rows[2], rows[3], rows[4],
                                 buffers[0] + GUARD + shift, buffers[0] + ROW_BYTES / 2 + shift,
                                 (uint32_t *)(void *)(buffers[1] + GUARD),
                                 (int32_t *)(void *)(buffers[3] + GUARD)}; /* each has room of two */
}

/* Bounds of dsp.h for x, y, xx, xy, yy; kinds: all, tiny (ties and zeros), extremes, mixed. */
static bool check_sides(const struct dsp_kernels *variant, unsigned width, unsigned kind, bool at_end)
{
    static const int32_t largest[5] = {18018, 18018, 24570, 9910, 24570};
    int16_t *rows[5];
    for (unsigned k = 0; k < 5; k++) {
        rows[k] = input(k, width, at_end);
        for (unsigned x = 0; x < width; x++) {
            const unsigned mode = kind % 4 == 3 ? (unsigned)(random_u64() % 3) : kind % 4;
            rows[k][x] = (int16_t)(mode == 0   ? random_within(largest[k])
                                   : mode == 1 ? random_within(3)
                                   : random_u64() % 2 != 0 ? largest[k]
                                                           : -largest[k]);
        }
    }
    const uint32_t thresholds[] = {0, 1, 9, 102400, 2000000, 1u << 29};
    const uint32_t threshold = thresholds[random_u64() % 6];
    const struct dsp_gradient reference = sides_in(expected, rows, kind % 3);
    const struct dsp_gradient own = sides_in(found, rows, kind % 3);
    fill_junk();
    dsp_scalar.sides(threshold, width, &reference);
    variant->sides(threshold, width, &own);
    for (unsigned x = 0; x < width; x++) {
        if (dsp_side(&reference, x) == 0) { /* the others may be anything */
            own.square_q6[x] = reference.square_q6[x];
            own.steered_qm6[x] = reference.steered_qm6[x];
        }
    }
    return same("sides", variant, width);
}

static bool check_products(const struct dsp_kernels *variant, unsigned count, unsigned kind)
{
    int16_t *columns = input(0, DSP_COLUMNS * DSP_BATCH, kind % 2 != 0);
    for (unsigned i = 0; i < DSP_COLUMNS * DSP_BATCH; i++) {
        columns[i] = (int16_t)(kind < 4    ? random_within(4095)
                               : kind == 4 ? 4095
                               : i % 2     ? 4095
                                           : -4095);
    }
    fill_junk();
    dsp_scalar.products(columns, count, (int64_t *)(void *)(expected[0] + GUARD));
    variant->products(columns, count, (int64_t *)(void *)(found[0] + GUARD));
    return same("products", variant, count);
}

static bool check_width(const struct dsp_kernels *variant, unsigned width)
{
    for (unsigned kind = 0; kind < 8; kind++) {
        const bool at_end = kind < 4;
        for (unsigned k = 0; k < TAPS_KERNELS; k++) {
            if (!check_along_x(variant, &taps_table[k], width, kind, at_end) ||
                !check_along_y(variant, &taps_table[k], width, kind, at_end)) {
                return false;
            }
        }
        if (!check_sides(variant, width, kind, at_end) || !check_widen(variant, width, at_end) ||
            !check_halve(variant, width, kind, at_end)) {
            return false;
        }
    }
    return true;
}

static bool check_variant(const struct dsp_kernels *variant)
{
    static const unsigned real_widths[] = {320, 321, 640, 1279, 1919, 1920, 4095, 4096};
    for (unsigned width = 1; width <= 48; width++) {
        for (unsigned round = 0; round < 3; round++) {
            if (!check_width(variant, width)) {
                return false;
            }
        }
    }
    for (unsigned i = 0; i < sizeof real_widths / sizeof real_widths[0]; i++) {
        if (!check_width(variant, real_widths[i])) {
            return false;
        }
    }
    for (unsigned count = 0; count <= DSP_BATCH; count += DSP_BATCH_STEP) {
        for (unsigned kind = 0; kind < 6; kind++) {
            if (!check_products(variant, count, kind)) {
                return false;
            }
        }
    }
    return simd_rim_same(variant, random_u64);
}

int main(void)
{
    const char *given = getenv("SEED");
    seed = given != NULL ? strtoull(given, NULL, 10) : (uint64_t)getpid() * 2654435761u;
    (void)printf("simd: seed %llu, variants %s\n", (unsigned long long)seed, dsp_choice_names());
    seed = seed * 2 + 1;
    map_inputs();
    unsigned checked = 0;
    for (unsigned i = 0; dsp_choice_at(i) != NULL; i++) {
        if (dsp_choice_at(i) != &dsp_scalar) {
            if (!check_variant(dsp_choice_at(i))) {
                return EXIT_FAILURE;
            }
            checked++;
        }
    }
    (void)printf("simd: %u variants equal the plain kernels\n", checked);
    return EXIT_SUCCESS;
}
