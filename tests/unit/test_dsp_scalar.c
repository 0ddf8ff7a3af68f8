/* The row kernels against plain convolution in double, on junk and on the inputs that drive each output to
 * its largest value. */
#include "firmware/detect/dsp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "tests/unit/synth.h"

#define WIDTH_MAX 40u
#define ROWS_MAX  (2 * TAPS_RADIUS_MAX + 1)

static uint16_t luma[ROWS_MAX][WIDTH_MAX + 2 * TAPS_RADIUS_MAX];
static int16_t  along_x[ROWS_MAX][3][WIDTH_MAX + 1]; /* one more: a guard */
static int16_t  derived[5][WIDTH_MAX + 1];
static uint8_t  strong[DSP_BITS_BYTES(WIDTH_MAX) + 1];
static uint8_t  bright[DSP_BITS_BYTES(WIDTH_MAX) + 1];
static uint32_t square_q6[WIDTH_MAX + 1];
static int32_t  steered_qm6[WIDTH_MAX + 1];
static struct dsp_row filtered[ROWS_MAX];
static struct dsp_gradient gradient;

#define GUARD 0x3c3c

void setUp(void) {}
void tearDown(void) {}

/* A kernel's value at signed distance k, as a correlation. */
static double tap(const struct taps *taps, int derivative, int k)
{
    const int at = abs(k);
    return derivative == 0   ? taps->smooth_q15[at] / 32768.0
           : derivative == 1 ? (k < 0 ? -1 : 1) * taps->first_q15[at] / 32768.0
                             : taps->second_q14[at] / 16384.0;
}

/* The derivative of order (dx, dy) at column x of the middle row, in grey_q4. */
static double exact(const struct taps *taps, int dx, int dy, unsigned x)
{
    const int r = (int)taps->radius;
    double sum = 0;
    for (int j = -r; j <= r; j++) {
        for (int i = -r; i <= r; i++) {
            sum += tap(taps, dy, j) * tap(taps, dx, i) * luma[j + r][(int)x + r + i];
        }
    }
    return sum;
}

static struct dsp_gradient own_gradient(void)
{
    return (struct dsp_gradient){derived[0], derived[1], derived[2], derived[3], derived[4],
                                 strong, bright, square_q6, steered_qm6};
}

static void run(const struct taps *taps, unsigned width)
{
    for (unsigned r = 0; r <= 2 * taps->radius; r++) {
        for (unsigned k = 0; k < 3; k++) {
            along_x[r][k][width] = GUARD;
        }
        filtered[r] = (struct dsp_row){along_x[r][0], along_x[r][1], along_x[r][2]};
        dsp_scalar.along_x(taps, luma[r] + taps->radius, width, &filtered[r]);
    }
    for (unsigned k = 0; k < 5; k++) {
        derived[k][width] = GUARD;
    }
    gradient = own_gradient();
    dsp_scalar.along_y(taps, filtered, width, &gradient);
    for (unsigned r = 0; r <= 2 * taps->radius; r++) {
        for (unsigned k = 0; k < 3; k++) {
            TEST_ASSERT_EQUAL_HEX16(GUARD, along_x[r][k][width]);
        }
    }
    for (unsigned k = 0; k < 5; k++) {
        TEST_ASSERT_EQUAL_HEX16(GUARD, derived[k][width]);
    }
}

/* gx^2 gxx + 2 gx gy gxy + gy^2 gyy in double (exact: below 2^53). */
static double steered(unsigned x)
{
    const double gx = gradient.x_q3[x];
    const double gy = gradient.y_q3[x];
    return gx * gx * gradient.xx_q2[x] + 2 * gx * gy * gradient.xy_q2[x] +
           gy * gy * gradient.yy_q2[x];
}

/* Roundings or truncations: the row pass is off by at most one unit of its format, which the column pass
 * weights with the sum of its kernel's magnitudes (1; 1.1; 3), and is off by one unit itself.
 * In units of the output: x, y (Q3): 1 + 1 and 1.1 + 1; xx (Q2): 1 + 1; xy (Q2, from Q3): 1.1 / 2 + 1;
 * yy (Q2, from Q3): 3 / 2 + 1. */
static void check_all(const struct taps *taps, unsigned width)
{
    for (unsigned x = 0; x < width; x++) {
        SYNTH_NEAR(2.0, exact(taps, 1, 0, x) * 8, gradient.x_q3[x]);
        SYNTH_NEAR(2.1, exact(taps, 0, 1, x) * 8, gradient.y_q3[x]);
        SYNTH_NEAR(2.0, exact(taps, 2, 0, x) * 4, gradient.xx_q2[x]);
        SYNTH_NEAR(1.6, exact(taps, 1, 1, x) * 4, gradient.xy_q2[x]);
        SYNTH_NEAR(2.5, exact(taps, 0, 2, x) * 4, gradient.yy_q2[x]);
        TEST_ASSERT_TRUE(fabs(steered(x)) < 17592186044416.0); /* 2^44: what dsp.h promises */
    }
}

static void derivatives_of_junk_agree_with_double_at_every_width(void)
{
    uint64_t seed = 5;
    for (unsigned k = 0; k < TAPS_KERNELS; k++) {
        for (unsigned width = 1; width <= WIDTH_MAX; width++) {
            for (unsigned i = 0; i < sizeof luma / sizeof luma[0][0]; i++) {
                (&luma[0][0])[i] = (uint16_t)(synth_u64(&seed) % 4096);
            }
            run(&taps_table[k], width);
            check_all(&taps_table[k], width);
        }
    }
}

/* Black where the product of the two kernels is negative at one pixel and white where it is positive drives
 * that pixel's output to its bound: an overflow of 16 bits would flip its sign. */
static void inputs_that_maximise_each_filter_do_not_overflow(void)
{
    static const int orders[5][2] = {{1, 0}, {0, 1}, {2, 0}, {1, 1}, {0, 2}};
    const unsigned width = 11;
    for (unsigned k = 0; k < TAPS_KERNELS; k++) {
        const struct taps *taps = &taps_table[k];
        const int r = (int)taps->radius;
        for (unsigned o = 0; o < 10; o++) {
            const int *order = orders[o / 2];
            memset(luma, 0, sizeof luma);
            for (int j = -r; j <= r; j++) {
                for (int i = -r; i <= r; i++) {
                    const double weight = tap(taps, order[0], i) * tap(taps, order[1], j);
                    const bool white = o % 2 ? weight < 0 : weight > 0;
                    luma[j + r][5 + r + i] = white ? 4095 : 0;
                }
            }
            run(taps, width);
            check_all(taps, width);
        }
    }
}

static void alternating_black_and_white_does_not_overflow(void)
{
    for (unsigned k = 0; k < TAPS_KERNELS; k++) {
        for (unsigned period = 1; period <= 6; period++) {
            for (unsigned kind = 0; kind < 3; kind++) {
                for (unsigned y = 0; y < ROWS_MAX; y++) {
                    for (unsigned x = 0; x < WIDTH_MAX + 2 * TAPS_RADIUS_MAX; x++) {
                        const unsigned stripes = kind == 0 ? x / period
                                                 : kind == 1 ? y / period
                                                             : x / period + y / period;
                        luma[y][x] = stripes % 2 ? 4095 : 0;
                    }
                }
                run(&taps_table[k], WIDTH_MAX);
                check_all(&taps_table[k], WIDTH_MAX);
            }
        }
    }
}

static void ramp_of_slope_one_has_slope_one_and_no_curvature(void)
{
    for (unsigned k = 0; k < TAPS_KERNELS; k++) {
        for (unsigned y = 0; y < ROWS_MAX; y++) {
            for (unsigned x = 0; x < WIDTH_MAX + 2 * TAPS_RADIUS_MAX; x++) {
                luma[y][x] = (uint16_t)(1000 + 10 * x + 20 * y);
            }
        }
        run(&taps_table[k], WIDTH_MAX);
        for (unsigned x = 0; x < WIDTH_MAX; x++) {
            /* Roundings as in check_all; the first moment's own error is 15 / 32768 of 160. */
            TEST_ASSERT_INT_WITHIN(2, 80, gradient.x_q3[x]);
            TEST_ASSERT_INT_WITHIN(2, 160, gradient.y_q3[x]);
            TEST_ASSERT_INT_WITHIN(2, 0, gradient.xx_q2[x]);
            TEST_ASSERT_INT_WITHIN(2, 0, gradient.yy_q2[x]);
        }
    }
}

static void fill_derivatives(uint64_t *seed, int32_t largest)
{
    for (unsigned k = 0; k < 5; k++) {
        for (unsigned x = 0; x < WIDTH_MAX; x++) {
            const int64_t wide = (int64_t)(synth_u64(seed) % (2u * (unsigned)largest + 1)) - largest;
            derived[k][x] = (int16_t)wide;
        }
    }
    gradient = own_gradient();
}

static void sides_are_the_sign_of_the_steered_second_derivative(void)
{
    uint64_t seed = 6;
    for (unsigned round = 0; round < 400; round++) {
        const uint32_t threshold_q6 = round % 2 ? 2000000 : 0;
        fill_derivatives(&seed, round % 4 < 2 ? 3000 : 4);
        memset(strong, 0x3c, sizeof strong);
        memset(bright, 0x3c, sizeof bright);
        dsp_scalar.sides(threshold_q6, WIDTH_MAX, &gradient);
        for (unsigned x = 0; x < WIDTH_MAX; x++) {
            const double strength =
                (double)gradient.x_q3[x] * gradient.x_q3[x] + (double)gradient.y_q3[x] * gradient.y_q3[x];
            const int expected = strength < threshold_q6 ? 0 : steered(x) < 0 ? -1 : 1;
            TEST_ASSERT_EQUAL_INT(expected, dsp_side(&gradient, x));
            TEST_ASSERT_TRUE((double)dsp_steered_q8(&gradient, x) == steered(x));
            if (expected != 0) {
                TEST_ASSERT_TRUE(square_q6[x] == strength);
                TEST_ASSERT_TRUE(steered_qm6[x] == floor(steered(x) / 16384));
            }
        }
        for (unsigned x = WIDTH_MAX; x < 8 * DSP_BITS_BYTES(WIDTH_MAX); x++) {
            TEST_ASSERT_EQUAL_INT(0, dsp_side(&gradient, x));
        }
        TEST_ASSERT_EQUAL_HEX8(0x3c, strong[DSP_BITS_BYTES(WIDTH_MAX)]);
        TEST_ASSERT_EQUAL_HEX8(0x3c, bright[DSP_BITS_BYTES(WIDTH_MAX)]);
    }
}

/* The bounds of dsp.h: |first| <= 18018, |second| <= 24570; xy comes from two first derivatives, at most
 * 4095 x 1.1 x 1.1 x 4 / 2 = 9910. All at once, in every combination of signs, which no image does: no 32-bit sum may
 * wrap even then. */
static void steering_the_largest_derivatives_does_not_overflow(void)
{
    for (unsigned signs = 0; signs < 32; signs++) {
        gradient = own_gradient();
        static const int largest[5] = {18018, 18018, 24570, 9910, 24570};
        for (unsigned k = 0; k < 5; k++) {
            derived[k][0] = (int16_t)(signs >> k & 1 ? -largest[k] : largest[k]);
        }
        TEST_ASSERT_TRUE((double)dsp_steered_q8(&gradient, 0) == steered(0));
        dsp_scalar.sides(1, 1, &gradient);
        TEST_ASSERT_EQUAL_INT(steered(0) < 0 ? -1 : 1, dsp_side(&gradient, 0));
        TEST_ASSERT_TRUE(steered_qm6[0] == floor(steered(0) / 16384));
    }
}

/* Grey levels of 256 come out times 16: the mean of four is four times their sum, without a rounding. */
static void halving_is_the_mean_of_four(void)
{
    uint64_t seed = 7;
    for (unsigned width = 0; width <= WIDTH_MAX; width++) {
        uint8_t above[2 * WIDTH_MAX];
        uint8_t below[2 * WIDTH_MAX];
        uint16_t halved[WIDTH_MAX + 1];
        for (unsigned i = 0; i < 2 * width; i++) {
            above[i] = (uint8_t)(width == 1 ? 255 : synth_u64(&seed));
            below[i] = (uint8_t)(width == 1 ? 255 : synth_u64(&seed));
        }
        halved[width] = GUARD;
        dsp_scalar.halve(above, below, width, halved);
        for (unsigned x = 0; x < width; x++) {
            const double mean = (above[2 * x] + above[2 * x + 1] + below[2 * x] + below[2 * x + 1]) / 4.0;
            TEST_ASSERT_TRUE(16 * mean == halved[x]);
        }
        TEST_ASSERT_EQUAL_HEX16(GUARD, halved[width]);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(derivatives_of_junk_agree_with_double_at_every_width);
    RUN_TEST(inputs_that_maximise_each_filter_do_not_overflow);
    RUN_TEST(alternating_black_and_white_does_not_overflow);
    RUN_TEST(ramp_of_slope_one_has_slope_one_and_no_curvature);
    RUN_TEST(sides_are_the_sign_of_the_steered_second_derivative);
    RUN_TEST(steering_the_largest_derivatives_does_not_overflow);
    RUN_TEST(halving_is_the_mean_of_four);
    return UNITY_END();
}
