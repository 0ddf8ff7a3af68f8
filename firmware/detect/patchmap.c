/* See patchmap.h. */
#include "firmware/detect/patchmap.h"

#include "common/fx/smallsolve.h"
#include "common/fx/turn.h"

#define LIMIT_Q30 ((int64_t)1 << 36)

struct patchmap patchmap_turned(uint16_t turn, uint32_t unit_q20)
{
    int32_t cos_q30;
    int32_t sin_q30;
    turn_cos_sin_q30(turn, &cos_q30, &sin_q30);
    const int64_t c = fx_round_shift_i64((int64_t)cos_q30 * unit_q20, 17); /* times 8 */
    const int64_t s = fx_round_shift_i64((int64_t)sin_q30 * unit_q20, 17);
    return (struct patchmap){.u_q30 = {0, c, s}, .v_q30 = {0, -s, c}, .terms = PATCHMAP_LINEAR};
}

static void sum_pairs(const struct patchmap_pair pairs[], unsigned count, const unsigned terms,
                      struct smallsolve *normal, struct patchmap *right)
{
    for (unsigned i = 0; i < count; i++) {
        const struct patchmap_pair *pair = &pairs[i];
        int64_t terms_q30[PATCHMAP_TERMS_MAX];
        patchmap_fill_terms(pair->p_q20, pair->q_q20, terms, terms_q30);
        for (unsigned row = 0; row < terms; row++) {
            for (unsigned col = 0; col <= row; col++) {
                normal->at_q30[row][col] += fx_mul_q30(terms_q30[row], terms_q30[col]);
            }
            right->u_q30[row] += fx_mul_q30(terms_q30[row], (int64_t)pair->place.u_q20 * 1024);
            right->v_q30[row] += fx_mul_q30(terms_q30[row], (int64_t)pair->place.v_q20 * 1024);
        }
    }
}

bool patchmap_fit(const struct patchmap_pair pairs[], unsigned count, unsigned terms, struct patchmap *map)
{
    assert(count >= 1 && count <= PATCHMAP_PAIRS_MAX);
    assert(terms == PATCHMAP_LINEAR || terms == PATCHMAP_TERMS_MAX);
    struct smallsolve normal = {.size = terms};
    *map = (struct patchmap){.terms = terms};
    sum_pairs(pairs, count, terms, &normal, map);
    for (unsigned row = 0; row < terms; row++) {
        for (unsigned col = 0; col <= row; col++) {
            normal.at_q30[row][col] /= count;
        }
        map->u_q30[row] /= count;
        map->v_q30[row] /= count;
    }
    if (!smallsolve_factor(&normal, (int64_t)1 << 12) || !smallsolve_solve(&normal, map->u_q30) ||
        !smallsolve_solve(&normal, map->v_q30)) {
        return false;
    }
    for (unsigned k = 0; k < terms; k++) {
        if (fx_abs_i64(map->u_q30[k]) > LIMIT_Q30 || fx_abs_i64(map->v_q30[k]) > LIMIT_Q30) {
            return false;
        }
    }
    return true;
}
