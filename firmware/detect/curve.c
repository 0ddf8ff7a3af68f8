/* Between the table's nodes. */
#include "firmware/detect/curve.h"

#define BLUR_STEP_Q16 9830 /* 0.15 */

static const int32_t aspects_q16[CURVE_ASPECTS] = {20972, 27525, 35389, 44564, 55050, 65536};

void curve_at(int64_t eps_q16, int64_t alpha_q16, int32_t terms_q14[CURVE_TERMS])
{
    const int64_t last_q16 = (CURVE_BLURS - 1) * BLUR_STEP_Q16;
    const int64_t eps = eps_q16 < 0 ? 0 : eps_q16 > last_q16 ? last_q16 : eps_q16;
    unsigned i = (unsigned)(eps / BLUR_STEP_Q16);
    i = i < CURVE_BLURS - 1 ? i : CURVE_BLURS - 2;
    const int32_t blur_q14 = (int32_t)(((eps - i * BLUR_STEP_Q16) << 14) / BLUR_STEP_Q16);

    unsigned k = 0;
    while (k < CURVE_ASPECTS - 2 && alpha_q16 >= aspects_q16[k + 1]) {
        k++;
    }
    const int64_t span = aspects_q16[k + 1] - aspects_q16[k];
    const int64_t into = alpha_q16 - aspects_q16[k];
    const int32_t aspect_q14 = (int32_t)(((into < 0 ? 0 : into > span ? span : into) << 14) / span);

    const int16_t *near = curve_table_q14[i][k];
    const int16_t *wide = curve_table_q14[i][k + 1];
    const int16_t *near_next = curve_table_q14[i + 1][k];
    const int16_t *wide_next = curve_table_q14[i + 1][k + 1];
    for (unsigned term = 0; term < CURVE_TERMS; term++) {
        const int32_t here = near[term] + (((wide[term] - near[term]) * aspect_q14) >> 14);
        const int32_t next =
            near_next[term] + (((wide_next[term] - near_next[term]) * aspect_q14) >> 14);
        terms_q14[term] = here + (((next - here) * blur_q14) >> 14);
    }
}
