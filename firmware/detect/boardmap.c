/* Fit coordinates are taken from the middle of the points and divided by 4, so that they stay within
 * one; pixels are counted from the middle in units of 2^12. */
#include "firmware/detect/boardmap.h"

#include "common/fx/fx.h"
#include "common/fx/smallsolve.h"

static void fill_terms(int64_t u_q30, int64_t v_q30, int64_t terms_q30[BOARDMAP_TERMS])
{
    terms_q30[0] = (int64_t)1 << 30;
    terms_q30[1] = u_q30;
    terms_q30[2] = v_q30;
    terms_q30[3] = fx_mul_q30(u_q30, u_q30);
    terms_q30[4] = fx_mul_q30(u_q30, v_q30);
    terms_q30[5] = fx_mul_q30(v_q30, v_q30);
}

bool boardmap_fit(const struct boardmap_pair pairs[], uint32_t count, struct boardmap *map)
{
    *map = (struct boardmap){0};
    if (count < BOARDMAP_PAIRS_MIN) {
        return false;
    }
    for (uint32_t i = 0; i < count; i++) {
        map->middle_u_q24 += pairs[i].u_q24;
        map->middle_v_q24 += pairs[i].v_q24;
        map->middle_x_q16 += pairs[i].x_px_q16;
        map->middle_y_q16 += pairs[i].y_px_q16;
    }
    map->middle_u_q24 /= count;
    map->middle_v_q24 /= count;
    map->middle_x_q16 /= count;
    map->middle_y_q16 /= count;

    struct smallsolve normal = {.size = BOARDMAP_TERMS};
    for (uint32_t i = 0; i < count; i++) {
        int64_t terms_q30[BOARDMAP_TERMS];
        fill_terms((pairs[i].u_q24 - map->middle_u_q24) * 16,
                   (pairs[i].v_q24 - map->middle_v_q24) * 16, terms_q30);
        const int64_t x_q30 = (pairs[i].x_px_q16 - map->middle_x_q16) * 4;
        const int64_t y_q30 = (pairs[i].y_px_q16 - map->middle_y_q16) * 4;
        for (unsigned row = 0; row < BOARDMAP_TERMS; row++) {
            for (unsigned col = 0; col <= row; col++) {
                normal.at_q30[row][col] += fx_mul_q30(terms_q30[row], terms_q30[col]);
            }
            map->x_q30[row] += fx_mul_q30(terms_q30[row], x_q30);
            map->y_q30[row] += fx_mul_q30(terms_q30[row], y_q30);
        }
    }
    for (unsigned row = 0; row < BOARDMAP_TERMS; row++) {
        for (unsigned col = 0; col <= row; col++) {
            normal.at_q30[row][col] /= count;
        }
        map->x_q30[row] /= count;
        map->y_q30[row] /= count;
    }
    /* Features of one patch alone reach pivots of 1e-5 in the second-order terms. */
    return smallsolve_factor(&normal, 256) && smallsolve_solve(&normal, map->x_q30) &&
           smallsolve_solve(&normal, map->y_q30);
}

static int64_t dot_terms(const int64_t a_q30[BOARDMAP_TERMS], const int64_t b_q30[BOARDMAP_TERMS])
{
    int64_t sum_q30 = 0;
    for (unsigned k = 0; k < BOARDMAP_TERMS; k++) {
        sum_q30 += fx_round_shift_i64((a_q30[k] >> 6) * b_q30[k], 24);
    }
    return sum_q30;
}

void boardmap_apply(const struct boardmap *map, int64_t u_q24, int64_t v_q24,
                    struct boardmap_place *out)
{
    const int64_t u = (u_q24 - map->middle_u_q24) * 16;
    const int64_t v = (v_q24 - map->middle_v_q24) * 16;
    int64_t place[BOARDMAP_TERMS];
    fill_terms(u, v, place);
    const int64_t by_u[BOARDMAP_TERMS] = {0, (int64_t)1 << 30, 0, 2 * u, v, 0};
    const int64_t by_v[BOARDMAP_TERMS] = {0, 0, (int64_t)1 << 30, 0, u, 2 * v};
    out->x_q16 = map->middle_x_q16 + dot_terms(map->x_q30, place) / 4;
    out->y_q16 = map->middle_y_q16 + dot_terms(map->y_q30, place) / 4;
    /* Per 4 sides, in 2^12 px: Q30 there is Q16 px a side after a shift by 4. */
    out->x_by_u_q16 = dot_terms(map->x_q30, by_u) >> 4;
    out->x_by_v_q16 = dot_terms(map->x_q30, by_v) >> 4;
    out->y_by_u_q16 = dot_terms(map->y_q30, by_u) >> 4;
    out->y_by_v_q16 = dot_terms(map->y_q30, by_v) >> 4;
}
