/* A wrong vector kernel is caught at its first wrong value, on a frame as it comes; right ones are not. */
#include "tests/golden/golden_run.c"

#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "firmware/app/dsp_choice.h"
#include "firmware/app/dsp_verify.h"

#define FRAME "tests/golden/frames/small.pgm"

static struct frame_view frame;
static struct dsp_kernels broken;
static char said[32]; /* the kernel that the first complaint names */
static unsigned complaints;
static unsigned calls;

static void listen(const char *kernel, const char *variant, unsigned count)
{
    TEST_ASSERT_EQUAL_STRING("broken", variant);
    TEST_ASSERT_TRUE(count > 0);
    if (complaints++ == 0) {
        (void)snprintf(said, sizeof said, "%s", kernel);
    }
}

void setUp(void)
{
    broken = *dsp_choice_at(0);
    broken.name = "broken";
    said[0] = '\0';
    complaints = 0;
    calls = 0;
    dsp_verify_tell(listen);
}

void tearDown(void)
{
    dsp_verify_tell(NULL);
}

/* ---- Kernels that are right but for one value of one call ---- */

/* Not the first: what comes late must be seen too. */
static bool goes_wrong(void)
{
    return calls++ == 3;
}

static void wrong_widen(const uint8_t *bytes, unsigned width, uint16_t *out)
{
    dsp_scalar.widen(bytes, width, out);
    out[width - 1] ^= goes_wrong() ? 16 : 0;
}

static void wrong_halve(const uint8_t *above, const uint8_t *below, unsigned width, uint16_t *out)
{
    dsp_scalar.halve(above, below, width, out);
    out[width / 2] ^= goes_wrong() ? 4 : 0;
}

static void wrong_along_x(const struct taps *taps, const uint16_t *luma, unsigned width,
                          const struct dsp_row *out)
{
    dsp_scalar.along_x(taps, luma, width, out);
    out->second_q2[0] = (int16_t)(out->second_q2[0] + (goes_wrong() ? 1 : 0));
}

static void wrong_along_y(const struct taps *taps, const struct dsp_row rows[], unsigned width,
                          const struct dsp_gradient *out)
{
    dsp_scalar.along_y(taps, rows, width, out);
    out->yy_q2[width - 1] = (int16_t)(out->yy_q2[width - 1] + (goes_wrong() ? 1 : 0));
}

static void wrong_sides(uint32_t threshold_q6, unsigned width, const struct dsp_gradient *out)
{
    dsp_scalar.sides(threshold_q6, width, out);
    out->bright[(width - 1) / 8] ^= goes_wrong() ? 1 : 0;
}

static void wrong_products(const int16_t *columns, unsigned count, int64_t sums[DSP_PRODUCTS])
{
    dsp_scalar.products(columns, count, sums);
    sums[DSP_PRODUCTS - 1] += goes_wrong() ? 1 : 0;
}

static void wrong_rim_rows(const struct rimrow_view *view, unsigned count, struct rimrow_batch *batch)
{
    dsp_scalar.rim_rows(view, count, batch);
    int16_t *last = &batch->columns[(RIMROW_COLUMNS - 1) * RIMROW_PIXELS + count - 1];
    *last = (int16_t)(*last + (count > 0 && goes_wrong() ? 1 : 0));
}

static void wrong_rim_span(const struct rimrow_steps *steps, int32_t p_q24, int32_t q_q24,
                           const uint8_t *bytes, unsigned count, int32_t *p_q14, int32_t *q_q14,
                           uint16_t *grey_q4)
{
    dsp_scalar.rim_span(steps, p_q24, q_q24, bytes, count, p_q14, q_q14, grey_q4);
    if (count > 0 && goes_wrong()) {
        q_q14[count - 1]++;
    }
}

static void wrong_rim_octants(const struct rimrow_batch *batch, unsigned count, uint32_t squares[8],
                              uint32_t counts[8])
{
    dsp_scalar.rim_octants(batch, count, squares, counts);
    counts[7] += count > 0 && goes_wrong() ? 1u : 0u;
}

/* ---- */

static void run_golden_frame(void)
{
    struct golden_result result;
    TEST_ASSERT_TRUE(golden_run(&frame, dsp_verify(&broken), &result));
    TEST_ASSERT_TRUE(result.features > 20);
}

static void right_kernels_pass(void)
{
    for (unsigned i = 0; dsp_choice_at(i) != NULL; i++) {
        broken = *dsp_choice_at(i);
        broken.name = "broken";
        run_golden_frame();
        TEST_ASSERT_EQUAL_UINT(0, complaints);
    }
}

static void expect_complaint(const char *kernel)
{
    run_golden_frame();
    TEST_ASSERT_TRUE_MESSAGE(calls > 3, kernel);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, complaints, kernel);
    TEST_ASSERT_EQUAL_STRING(kernel, said);
    setUp();
}

static void one_wrong_value_of_any_kernel_is_named(void)
{
    broken.widen = wrong_widen;
    expect_complaint("widen");
    broken.halve = wrong_halve;
    expect_complaint("halve");
    broken.along_x = wrong_along_x;
    expect_complaint("along_x");
    broken.along_y = wrong_along_y;
    expect_complaint("along_y");
    broken.sides = wrong_sides;
    expect_complaint("sides");
    broken.products = wrong_products;
    expect_complaint("products");
    broken.rim_rows = wrong_rim_rows;
    expect_complaint("rim_rows");
    broken.rim_span = wrong_rim_span;
    expect_complaint("rim_span");
    broken.rim_octants = wrong_rim_octants;
    expect_complaint("rim_octants");
}

int main(void)
{
    static uint8_t bytes[1 << 19];
    FILE *file = fopen(FRAME, "rb");
    const size_t count = file != NULL ? fread(bytes, 1, sizeof bytes, file) : 0;
    if (file == NULL || !golden_parse(bytes, count, &frame)) {
        (void)printf("%s: no golden frame\n", FRAME);
        return 1;
    }
    (void)fclose(file);
    UNITY_BEGIN();
    RUN_TEST(right_kernels_pass);
    RUN_TEST(one_wrong_value_of_any_kernel_is_named);
    return UNITY_END();
}
