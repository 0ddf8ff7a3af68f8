#include "firmware/detect/junction.h"

#include "firmware/detect/profile.h"

/* Edges farther off than this, in blurs, bring nothing; the tables end there too. */
#define REACH_Q16 ((int64_t)4 << 16)
/* The variance of what comes from behind stays above 1 - lambda (lambda - t) >= 0.05 for t up to 4. */
#define VARIANCE_MIN_Q24 ((int64_t)1 << 19)

static int64_t at_place(const struct felt_line *line, int32_t p_q14, int32_t q_q14)
{
    return line->t0_q16 + ((line->tp_q16 * p_q14 + line->tq_q16 * q_q14) >> 14);
}

/* The share, Q15, of what comes from behind the edge that comes from beyond the ray. */
static int32_t beyond_ray_q15(const struct junction_ray *ray, int64_t t_q16, int64_t lambda_q16,
                              int32_t p_q14, int32_t q_q14)
{
    const int64_t mean_q16 =
        at_place(&ray->line, p_q14, q_q14) - ((ray->lean_q15 * lambda_q16) >> 15);
    const int64_t lean_q24 = ((int64_t)ray->lean_q15 * ray->lean_q15) >> 6;
    const int64_t cut_q16 = (lambda_q16 * (lambda_q16 - t_q16)) >> 16;
    int64_t variance_q24 = ((int64_t)1 << 24) - ((lean_q24 * cut_q16) >> 16);
    variance_q24 = variance_q24 < VARIANCE_MIN_Q24 ? VARIANCE_MIN_Q24 : variance_q24;
    const int64_t over_q16 = profile_inverse_q16((uint32_t)variance_q24);
    int64_t u_q16 = (mean_q16 * over_q16) >> 16;
    u_q16 = u_q16 > REACH_Q16 ? REACH_Q16 : u_q16 < -REACH_Q16 ? -REACH_Q16 : u_q16;
    int32_t bell_q15;
    return profile_edge((int32_t)u_q16, &bell_q15);
}

bool junction_add(const struct junction *junction, int32_t p_q14, int32_t q_q14, int32_t *share_q15,
                  int32_t *growth_q15)
{
    const int64_t t_q16 = at_place(&junction->edge, p_q14, q_q14);
    if (t_q16 < 0) {
        return false;
    }
    if (t_q16 >= REACH_Q16) {
        return true;
    }
    int32_t bell_q15;
    const int32_t tail_q15 = profile_edge((int32_t)-t_q16, &bell_q15);
    /* lambda lies between t and t + 0.8: that it is kept there mends the last digits of a small tail. */
    const int64_t ratio_q16 = ((int64_t)bell_q15 << 16) / (tail_q15 > 0 ? tail_q15 : 1);
    const int64_t most_q16 = t_q16 + FX_Q(0.7979, 16);
    const int64_t lambda_q16 =
        ratio_q16 < t_q16 ? t_q16 : ratio_q16 > most_q16 ? most_q16 : ratio_q16;
    int64_t other_q15 = (int64_t)junction->first << 15;
    for (unsigned i = 0; i < junction->ray_count; i++) {
        const struct junction_ray *ray = &junction->rays[i];
        other_q15 += ray->step * beyond_ray_q15(ray, t_q16, lambda_q16, p_q14, q_q14);
    }
    other_q15 = other_q15 < 0 ? 0 : other_q15 > 32768 ? 32768 : other_q15;
    *share_q15 += (int32_t)((other_q15 * tail_q15) >> 15);
    *growth_q15 += (int32_t)((((other_q15 * bell_q15) >> 15) * t_q16) >> 16);
    return true;
}
