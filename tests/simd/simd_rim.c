/* Views and pixels are random within the ranges of rimrow.h, each number at one of its bounds now and then.
 * Whole batches are compared, inputs and what lies beyond `count` too, between guards. */
#include "tests/simd/simd_rim.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define ROUNDS 1500u
#define GUARD  64u
#define P_MAX_Q14 57343 /* below 3.5 */

struct guarded {
    uint8_t             before[GUARD];
    struct rimrow_batch batch;
    uint8_t             after[GUARD];
};

struct octants {
    uint32_t before[4];
    uint32_t squares[8];
    uint32_t counts[8];
    uint32_t after[4];
};

static uint64_t (*random_u64)(void);
static struct guarded expected;
static struct guarded found;

/* From low to high; one in eight is the one or the other. */
static int32_t within(int32_t low, int32_t high)
{
    const uint64_t pick = random_u64() % 16;
    return pick == 0   ? low
           : pick == 1 ? high
                       : low + (int32_t)(random_u64() % ((uint64_t)((int64_t)high - low) + 1));
}

static double share(void)
{
    return (double)(random_u64() >> 11) / 9007199254740992.0;
}

/* Semi-axes over R, alpha^-1/2 and alpha^1/2: (R / h)^2 runs from alpha to 1 / alpha. Returns s / R. */
static double random_shape(struct rimrow_view *view)
{
    const double alpha = random_u64() % 8 == 0 ? 0.126 : 0.126 + 0.874 * share();
    const double swing = (1 / alpha - alpha) / 2;
    const double turn = 6.283185307179586 * share();
    const int64_t inverse_q24[3] = {(int64_t)((alpha + 1 / alpha) / 2 * 16777216),
                                    (int64_t)(swing * cos(turn) * 16777216), (int64_t)(swing * sin(turn) * 16777216)};
    const double over_blur = exp(share() * log(4000.0)); /* R / s */
    rimrow_set_shape(view, inverse_q24, (int64_t)(16777216 / alpha), (int64_t)(65536 * over_blur));
    const int64_t eps_q16 = (int64_t)(65535 / over_blur);
    int32_t curve_q14[CURVE_TERMS];
    curve_at(eps_q16, (int64_t)(alpha * 65536), curve_q14);
    rimrow_set_bend(view, curve_q14, eps_q16);
    return (double)eps_q16 / 65536;
}

static struct rimrow_view random_view(unsigned round, double *eps)
{
    struct rimrow_view view = {
        .gap_q11 = (int16_t)within(0, INT16_MAX),
        .band_q14 = (int16_t)within(1 << 14, RIMROW_BAND_MAX_Q14),
        .clear_q11 = random_u64() % 2 != 0 ? 307 * 8 : 563 * 8,
        .near_q11 = (int16_t)within(0, 4 << 11),
        .over_rim = rimrow_gain_of(within(1 << 24, 16 << 24)),
        .level_q5 = within(-(1 << 19), 1 << 19),
        .level_p_q5 = within(-(1 << 14), 1 << 14),
        .level_q_q5 = within(-(1 << 14), 1 << 14),
        .contrast_q2 = within(-(1 << 14), 1 << 14),
        .contrast_p_q2 = within(-(1 << 12), 1 << 12),
        .contrast_q_q2 = within(-(1 << 12), 1 << 12),
        .rest_shift = round / 4 % 2 != 0 ? 5 : 0,
        .edge_q14 = (int16_t)within(0, (2 << 14) - 1),
        .peak = rimrow_gain_of(within(0, 40 << 24)),
        .peak_shown_q15 = random_u64() % 2 != 0 ? INT16_MAX : 0,
        .edge_count = round % (RIMROW_GIVEN + 1),
        .edge_shift = (uint32_t)within(2, 14),
    };
    if (random_u64() % 2 != 0) { /* a real picture: rests that are not all cut */
        view.level_q5 = within(0, 4095 * 32);
        view.contrast_q2 = within(-4095 * 4, 4095 * 4);
        view.level_p_q5 = view.level_q_q5 = view.contrast_p_q2 = view.contrast_q_q2 = 0;
        view.edge_q14 = (int16_t)within(1 << 13, 1 << 14);
        view.peak = rimrow_gain_of(within(0, 1 << 24));
    }
    for (unsigned k = 0; k < RIMROW_EDGES; k++) {
        const bool around = random_u64() % 2 != 0;
        view.edges[k] = (struct rimrow_edge){
            around ? within(0, 8 << 11) : within(-(1 << 22), 1 << 22),
            within(-(1 << 14), 1 << 14), within(-(1 << 14), 1 << 14)};
    }
    rimrow_set_fall(&view, within(0, 16 << 15), within(0, 16 << 15));
    *eps = random_shape(&view);
    return view;
}

/* In the band, anywhere within the range, at the edges of [1/8, 8), or padding. */
static void random_pixel(double eps, struct rimrow_batch *batch, unsigned i)
{
    batch->grey_q4[i] = (uint16_t)within(0, 4095);
    batch->others_q14[i] =
        (int16_t)(random_u64() % 8 == 0 ? RIMROW_BEYOND_Q14 : within(0, 3 << 13));
    batch->growth_q14[i] = (int16_t)within(0, 1 << 14);
    if (random_u64() % 8 == 0) {
        do {
            batch->p_q14[i] = within(-P_MAX_Q14, P_MAX_Q14);
            batch->q_q14[i] = within(-P_MAX_Q14, P_MAX_Q14);
        } while (hypot(batch->p_q14[i], batch->q_q14[i]) > P_MAX_Q14);
        return;
    }
    static const double bounds[] = {0.35355339, 2.82842712, 1.0, 3.4999};
    const double band = 3.0 * eps;
    const double rho = random_u64() % 8 == 0 ? bounds[random_u64() % 4]
                                             : fmax(0, 1 + band * (2 * share() - 1));
    const double turn = random_u64() % 8 == 0 ? 0.7853981633974483 * (double)(random_u64() % 8)
                                              : 6.283185307179586 * share();
    batch->p_q14[i] = (int32_t)lrint(rho * cos(turn) * 16384);
    batch->q_q14[i] = (int32_t)lrint(rho * sin(turn) * 16384);
}

static bool same(const char *kernel, const struct dsp_kernels *variant, const void *a, const void *b,
                 size_t bytes, unsigned round)
{
    if (memcmp(a, b, bytes) == 0) {
        return true;
    }
    (void)printf("simd: %s of %s differs in round %u\n", kernel, variant->name, round);
    return false;
}

/* Also tells how many pixels were kept. */
static bool check_rows(const struct dsp_kernels *variant, unsigned round, unsigned *kept)
{
    double eps;
    const struct rimrow_view view = random_view(round, &eps);
    const unsigned count = RIMROW_STEP * (unsigned)(random_u64() % (RIMROW_PIXELS / RIMROW_STEP + 1));
    memset(&expected, 0x5a, sizeof expected);
    for (unsigned i = 0; i < count; i++) {
        random_pixel(eps, &expected.batch, i);
    }
    found = expected;
    dsp_scalar.rim_rows(&view, count, &expected.batch);
    variant->rim_rows(&view, count, &found.batch);
    for (unsigned i = 0; i < count; i++) {
        *kept += expected.batch.octant[i] < 8 ? 1 : 0;
    }
    struct octants one;
    struct octants other;
    memset(&one, 0x5a, sizeof one);
    other = one;
    dsp_scalar.rim_octants(&expected.batch, count, one.squares, one.counts);
    variant->rim_octants(&found.batch, count, other.squares, other.counts);
    return same("rim_rows", variant, &expected, &found, sizeof expected, round) &&
           same("rim_octants", variant, &one, &other, sizeof one, round);
}

/* The largest rests in any octants: squares at their bound of 128 times 2^24. */
static bool check_octants(const struct dsp_kernels *variant, unsigned round)
{
    int16_t *rests = expected.batch.columns + (RIMROW_COLUMNS - 1) * RIMROW_PIXELS;
    for (unsigned i = 0; i < RIMROW_PIXELS; i++) {
        rests[i] = (int16_t)(random_u64() % 2 != 0 ? 4095 : -4095);
        expected.batch.octant[i] = (int16_t)(round % 2 != 0 ? round / 2 % 9 : random_u64() % 9);
    }
    struct octants one;
    struct octants other;
    memset(&one, 0x5a, sizeof one);
    other = one;
    dsp_scalar.rim_octants(&expected.batch, RIMROW_PIXELS, one.squares, one.counts);
    variant->rim_octants(&expected.batch, RIMROW_PIXELS, other.squares, other.counts);
    return same("rim_octants", variant, &one, &other, sizeof one, round);
}

/* Starts and steps such that every place stays within the range, as rim.h has them; with bytes and without. */
static bool check_span(const struct dsp_kernels *variant, unsigned round)
{
    const unsigned count = (unsigned)(random_u64() % (RIMROW_PIXELS + 1));
    const unsigned at = (unsigned)(random_u64() % (RIMROW_PIXELS - count + 1));
    const int32_t most_q24 = P_MAX_Q14 << 10;
    const int32_t steps = (int32_t)count + 2 * RIMROW_RAMP;
    int32_t from[2];
    int32_t step[2];
    for (unsigned axis = 0; axis < 2; axis++) {
        from[axis] = within(-most_q24, most_q24);
        step[axis] = (within(-most_q24, most_q24) - from[axis]) / steps;
    }
    struct rimrow_steps along;
    for (int32_t i = 0; i <= RIMROW_RAMP; i++) {
        along.p_q24[i] = i * step[0];
        along.q_q24[i] = i * step[1];
    }
    uint8_t bytes[RIMROW_PIXELS + RIMROW_RAMP];
    for (unsigned i = 0; i < sizeof bytes; i++) {
        bytes[i] = (uint8_t)random_u64();
    }
    const uint8_t *given = round % 2 != 0 ? bytes : NULL;
    memset(&expected, 0x5a, sizeof expected);
    found = expected;
    dsp_scalar.rim_span(&along, from[0], from[1], given, count, expected.batch.p_q14 + at,
                        expected.batch.q_q14 + at, expected.batch.grey_q4 + at);
    variant->rim_span(&along, from[0], from[1], given, count, found.batch.p_q14 + at, found.batch.q_q14 + at,
                      found.batch.grey_q4 + at);
    return same("rim_span", variant, &expected, &found, sizeof expected, round);
}

bool simd_rim_same(const struct dsp_kernels *variant, uint64_t (*random)(void))
{
    random_u64 = random;
    unsigned kept = 0;
    for (unsigned round = 0; round < ROUNDS; round++) {
        if (!check_rows(variant, round, &kept) || !check_octants(variant, round) ||
            !check_span(variant, round)) {
            return false;
        }
    }
    if (kept < 10 * ROUNDS) { /* of 64 pixels a round: else little was compared but zeros */
        (void)printf("simd: only %u of the rim's pixels were kept\n", kept);
        return false;
    }
    return true;
}
