/* Fit coordinates are taken from the middle of the points and divided by 4, so that they stay within one; pixels are
 * counted from the middle in units of 2^12. Q24 sides are Q26 then, and Q16 pixels Q28: sums of whole products of up to
 * 2^8 points stay below 2^63, and nothing is rounded but what is of second order.
 *
 * The normal equations of 1, u, v, u^2, u v, v^2 are moments up to the fourth order: fifteen, not twenty-one. Those of
 * the first order, and the sums of x and y, are zero by the choice of the middle. */
#include "firmware/detect/boardmap.h"

#include <stddef.h>

#include "common/fx/fx.h"
#include "common/fx/smallsolve.h"

#define PAIRS_MAX 256u

struct moments {
    int64_t second_q52[3]; /* u^2, u v, v^2 */
    int64_t third_q52[4];  /* u^3, u^2 v, ... */
    int64_t fourth_q52[5];
    int64_t x_q54[BOARDMAP_TERMS]; /* with each term but the first */
    int64_t y_q54[BOARDMAP_TERMS];
};

static void find_middle(const struct boardmap_pair pairs[], uint32_t count, struct boardmap *map)
{
    int64_t u_q24 = 0;
    int64_t v_q24 = 0;
    int64_t x_q16 = 0;
    int64_t y_q16 = 0;
    for (uint32_t i = 0; i < count; i++) {
        u_q24 += pairs[i].u_q24;
        v_q24 += pairs[i].v_q24;
        x_q16 += pairs[i].x_px_q16;
        y_q16 += pairs[i].y_px_q16;
    }
    map->middle_u_q24 = u_q24 / count;
    map->middle_v_q24 = v_q24 / count;
    map->middle_x_q16 = x_q16 / count;
    map->middle_y_q16 = y_q16 / count;
}

static void sum_moments(const struct boardmap_pair pairs[], uint32_t count, const struct boardmap *map,
                        struct moments *out)
{
    struct moments sum = {0};
    for (uint32_t i = 0; i < count; i++) {
        const int64_t u = pairs[i].u_q24 - map->middle_u_q24;
        const int64_t v = pairs[i].v_q24 - map->middle_v_q24;
        const int64_t second[3] = {u * u, u * v, v * v};
        const int64_t uu = fx_round_shift_i64(second[0], 26);
        const int64_t uv = fx_round_shift_i64(second[1], 26);
        const int64_t vv = fx_round_shift_i64(second[2], 26);
        sum.second_q52[0] += second[0];
        sum.second_q52[1] += second[1];
        sum.second_q52[2] += second[2];
        sum.third_q52[0] += uu * u;
        sum.third_q52[1] += uu * v;
        sum.third_q52[2] += vv * u;
        sum.third_q52[3] += vv * v;
        sum.fourth_q52[0] += uu * uu;
        sum.fourth_q52[1] += uu * uv;
        sum.fourth_q52[2] += uu * vv;
        sum.fourth_q52[3] += uv * vv;
        sum.fourth_q52[4] += vv * vv;
        const int64_t x = pairs[i].x_px_q16 - map->middle_x_q16;
        const int64_t y = pairs[i].y_px_q16 - map->middle_y_q16;
        const int64_t terms[BOARDMAP_TERMS] = {0, u, v, uu, uv, vv};
        for (unsigned k = 1; k < BOARDMAP_TERMS; k++) {
            sum.x_q54[k] += terms[k] * x;
            sum.y_q54[k] += terms[k] * y;
        }
    }
    *out = sum;
}

/* The moment that stands in row and column: by the powers of u and v. */
static int64_t moment_q30(const struct moments *sum, unsigned row, unsigned col, uint32_t count)
{
    static const uint8_t order[BOARDMAP_TERMS] = {0, 1, 1, 2, 2, 2};
    static const uint8_t power_of_v[BOARDMAP_TERMS] = {0, 0, 1, 0, 1, 2};
    const unsigned v = power_of_v[row] + power_of_v[col];
    switch (order[row] + order[col]) {
    case 0:
        return (int64_t)1 << 30;
    case 1:
        return 0;
    case 2:
        return fx_round_shift_i64(sum->second_q52[v] / count, 22);
    case 3:
        return fx_round_shift_i64(sum->third_q52[v] / count, 22);
    default:
        return fx_round_shift_i64(sum->fourth_q52[v] / count, 22);
    }
}

bool boardmap_fit(const struct boardmap_pair pairs[], uint32_t count, struct boardmap *map)
{
    assert(count <= PAIRS_MAX);
    if (count < BOARDMAP_PAIRS_MIN) {
        return false;
    }
    find_middle(pairs, count, map);
    struct moments sum;
    sum_moments(pairs, count, map, &sum);
    struct smallsolve normal;
    normal.size = BOARDMAP_TERMS;
    int64_t x_q30[BOARDMAP_TERMS];
    int64_t y_q30[BOARDMAP_TERMS];
    for (unsigned row = 0; row < BOARDMAP_TERMS; row++) {
        for (unsigned col = 0; col <= row; col++) {
            normal.at_q30[row][col] = moment_q30(&sum, row, col, count);
        }
        x_q30[row] = fx_round_shift_i64(sum.x_q54[row] / count, 24);
        y_q30[row] = fx_round_shift_i64(sum.y_q54[row] / count, 24);
    }
    /* Features of one patch alone reach pivots of 1e-5 in the second-order terms. */
    if (!smallsolve_factor(&normal, SMALLSOLVE_FLOOR_MIN_Q30) || !smallsolve_solve(&normal, x_q30) ||
        !smallsolve_solve(&normal, y_q30)) {
        return false;
    }
    for (unsigned k = 0; k < BOARDMAP_TERMS; k++) {
        map->x_q24[k] = fx_round_shift_i64(x_q30[k], 6);
        map->y_q24[k] = fx_round_shift_i64(y_q30[k], 6);
    }
    return true;
}

/* A place and what is of second order there, Q26. */
struct terms {
    int64_t u;
    int64_t v;
    int64_t uu;
    int64_t uv;
    int64_t vv;
};

static struct terms make_terms(const struct boardmap *map, int64_t u_q24, int64_t v_q24)
{
    const int64_t u = u_q24 - map->middle_u_q24;
    const int64_t v = v_q24 - map->middle_v_q24;
    return (struct terms){u, v, fx_round_shift_i64(u * u, 26), fx_round_shift_i64(u * v, 26),
                          fx_round_shift_i64(v * v, 26)};
}

/* In units of 2^12 px, Q50: pixels in Q16 after a shift by 22. Coefficients are below 2^32. */
static int64_t value_px_q16(const int64_t k_q24[BOARDMAP_TERMS], const struct terms *at)
{
    return fx_round_shift_i64(k_q24[0] * ((int64_t)1 << 26) + k_q24[1] * at->u + k_q24[2] * at->v +
                                  k_q24[3] * at->uu + k_q24[4] * at->uv + k_q24[5] * at->vv, 22);
}

/* Likewise, and per 4 sides. */
static int64_t by_u_px_q16(const int64_t k_q24[BOARDMAP_TERMS], const struct terms *at)
{
    return fx_round_shift_i64(k_q24[1] * ((int64_t)1 << 26) + k_q24[3] * 2 * at->u + k_q24[4] * at->v, 24);
}

static int64_t by_v_px_q16(const int64_t k_q24[BOARDMAP_TERMS], const struct terms *at)
{
    return fx_round_shift_i64(k_q24[2] * ((int64_t)1 << 26) + k_q24[4] * at->u + k_q24[5] * 2 * at->v, 24);
}

struct boardmap_point boardmap_point_at(const struct boardmap *map, int64_t u_q24, int64_t v_q24)
{
    const struct terms at = make_terms(map, u_q24, v_q24);
    return (struct boardmap_point){map->middle_x_q16 + value_px_q16(map->x_q24, &at),
                                   map->middle_y_q16 + value_px_q16(map->y_q24, &at)};
}

void boardmap_slopes_at(const struct boardmap *map, int64_t u_q24, int64_t v_q24,
                        struct boardmap_slopes *out)
{
    const struct terms at = make_terms(map, u_q24, v_q24);
    *out = (struct boardmap_slopes){
        .x_by_u_q16 = by_u_px_q16(map->x_q24, &at),
        .x_by_v_q16 = by_v_px_q16(map->x_q24, &at),
        .y_by_u_q16 = by_u_px_q16(map->y_q24, &at),
        .y_by_v_q16 = by_v_px_q16(map->y_q24, &at),
    };
}
