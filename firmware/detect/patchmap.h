/* A map from the frame of one anchor to its patch: of first order, or of second. */
#ifndef TESSERA_FIRMWARE_DETECT_PATCHMAP_H
#define TESSERA_FIRMWARE_DETECT_PATCHMAP_H

#include <stdbool.h>
#include <stdint.h>

#include "common/fx/fx.h"

#define PATCHMAP_TERMS_MAX 6u
#define PATCHMAP_LINEAR    3u
#define PATCHMAP_PAIRS_MAX 16u

/* w = sum_k coefficient_k term_k(p / 8, q / 8), terms 1, p, q, p^2, p q, q^2; those from `terms` on are not there. */
struct patchmap {
    int64_t  u_q30[PATCHMAP_TERMS_MAX];
    int64_t  v_q30[PATCHMAP_TERMS_MAX];
    unsigned terms;
};

/* In the patch, from the anchor, in sides. */
struct patchmap_place {
    int32_t u_q20;
    int32_t v_q20;
};

/* A place around the anchor, and where it lies in the patch. |p| and |q| below 11.3. */
struct patchmap_pair {
    int32_t p_q20;
    int32_t q_q20;
    struct patchmap_place place;
};

static inline void patchmap_fill_terms(int32_t p_q20, int32_t q_q20, unsigned terms,
                                       int64_t terms_q30[PATCHMAP_TERMS_MAX])
{
    const int64_t p = (int64_t)p_q20 * 128; /* p / 8 in Q30; |p / 8| < 2 */
    const int64_t q = (int64_t)q_q20 * 128;
    terms_q30[0] = (int64_t)1 << 30;
    terms_q30[1] = p;
    terms_q30[2] = q;
    if (terms > PATCHMAP_LINEAR) {
        terms_q30[3] = fx_mul_q30(p, p);
        terms_q30[4] = fx_mul_q30(p, q);
        terms_q30[5] = fx_mul_q30(q, q);
    }
}

/* Here for its caller's loop over all neighbours. */
static inline struct patchmap_place patchmap_place_of(const struct patchmap *map, int32_t p_q20, int32_t q_q20)
{
    const unsigned terms = map->terms == PATCHMAP_LINEAR ? PATCHMAP_LINEAR : PATCHMAP_TERMS_MAX;
    int64_t terms_q30[PATCHMAP_TERMS_MAX];
    patchmap_fill_terms(p_q20, q_q20, terms, terms_q30);
    /* Coefficients count in Q22. */
    int64_t u_q30 = map->u_q30[0] & ~(int64_t)255;
    int64_t v_q30 = map->v_q30[0] & ~(int64_t)255;
    for (unsigned k = 1; k < terms; k++) {
        u_q30 += fx_round_shift_i64((map->u_q30[k] >> 8) * terms_q30[k], 22);
        v_q30 += fx_round_shift_i64((map->v_q30[k] >> 8) * terms_q30[k], 22);
    }
    const struct patchmap_place place = {fx_saturate_i32(u_q30 >> 10), fx_saturate_i32(v_q30 >> 10)};
    return place;
}

/* The map for a patch whose u axis points along `turn`: a rotation by -turn, scaled by the unit of p and q in sides. */
struct patchmap patchmap_turned(uint16_t turn, uint32_t unit_q20);

/* Least squares with the first `terms` terms, 3 or 6. At most PATCHMAP_PAIRS_MAX pairs, at least one. False where they
 * do not tell a map, or one that leaves its range. */
bool patchmap_fit(const struct patchmap_pair pairs[], unsigned count, unsigned terms, struct patchmap *map);

#endif
