/* The rows of the rim's pixels (rimrow.h) against the same mathematics in double.
 *
 * Errors of the fixed-point places are bounded first (struct slack); the model in double, moved by so much in every
 * direction, then says how far a row may be off. */
#include "firmware/detect/dsp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "tests/unit/synth.h"

static struct rimrow_batch batch;

void setUp(void)
{
    memset(&batch, 0, sizeof batch);
}
void tearDown(void) {}

static double within(uint64_t *seed, double low, double high)
{
    return low + (high - low) * synth_uniform(seed);
}

/* A view, and what it was made from. */
struct rim_case {
    struct rimrow_view view;
    int32_t            curve_q14[CURVE_TERMS];
    double             eps;
    double             over_rim;
    double             peak; /* A */
};

static void set_peak(struct rim_case *of, double peak)
{
    of->peak = peak;
    of->view.peak = rimrow_gain_of(llround(ldexp(peak / 0.398942280401 / 2, 24)));
}

static void set_over_rim(struct rim_case *of, double over_rim)
{
    of->over_rim = over_rim;
    of->view.over_rim = rimrow_gain_of(llround(ldexp(over_rim, 24)));
}

/* A view of an ellipse with semi-axes alpha^-1/2 and alpha^1/2 (R = 1), turned by `turn` of the doubled angle;
 * R / s = over_blur. The circle is plain, of its full swing, and far from everything. */
static struct rim_case make_case(double alpha, double turn, double over_blur)
{
    const double swing = (1 / alpha - alpha) / 2;
    struct rim_case of = {.eps = fmin(0.99, 1 / over_blur)};
    of.view = (struct rimrow_view){
        .gap_q11 = (16 << 11) - 1,
        .band_q14 = RIMROW_BAND_MAX_Q14,
        .clear_q11 = 307 * 8,
        .near_q11 = 2 << 11,
        .contrast_q2 = 1000 * 4,
        .level_q5 = 2000 * 32,
        .edge_q14 = 1 << 14,
        .edge_shift = 10,
    };
    const int64_t inverse_q24[3] = {llround((alpha + 1 / alpha) / 2 * 16777216), llround(swing * cos(turn) * 16777216),
                                    llround(swing * sin(turn) * 16777216)};
    rimrow_set_shape(&of.view, inverse_q24, llround(16777216 / alpha), llround(65536 * over_blur));
    curve_at(llround(of.eps * 65536), llround(alpha * 65536), of.curve_q14);
    rimrow_set_bend(&of.view, of.curve_q14, llround(of.eps * 65536));
    set_over_rim(&of, 1);
    set_peak(&of, 0);
    return of;
}

/* What the fixed-point numbers of a pixel are, in double. */
struct place {
    double tau;
    double h;
    double y;
    double cos1;
    double sin1;
    double cos2;
    double sin2;
    double square;
    double apart[RIMROW_EDGES];
};

struct row {
    double at[RIMROW_COLUMNS];
};

/* i1 cos 2a + i2 sin 2a. */
static double inverse_swing(const struct rimrow_view *view, double cos2, double sin2)
{
    return ldexp(view->inverse_cos_q14 * cos2 + view->inverse_sin_q14 * sin2, (int)view->wide - 14);
}

static struct place place_of(const struct rimrow_view *view, int32_t p_q14, int32_t q_q14)
{
    struct place at;
    const double p = p_q14 / 16384.0;
    const double q = q_q14 / 16384.0;
    const double rho = hypot(p, q);
    at.square = rho * rho;
    at.cos1 = p / rho;
    at.sin1 = q / rho;
    at.cos2 = at.cos1 * at.cos1 - at.sin1 * at.sin1;
    at.sin2 = 2 * at.cos1 * at.sin1;
    at.y = inverse_swing(view, at.cos2, at.sin2);
    at.h = 1 / sqrt(ldexp(view->inverse_q13, (int)view->wide - 13) + at.y);
    at.tau = (1 - rho) * at.h * ldexp(view->depth_q14, -3 - (int)view->depth_shift);
    for (unsigned k = 0; k < view->edge_count; k++) {
        at.apart[k] = view->edges[k].t0_q11 / 2048.0 +
                      ldexp(view->edges[k].tp * p + view->edges[k].tq * q,
                            3 - (int)view->edge_shift);
    }
    return at;
}

static double normal(double t)
{
    return erfc(-t / sqrt(2)) / 2;
}

static double bell(double t)
{
    return exp(-t * t / 2) / sqrt(2 * SYNTH_PI);
}

/* t by curve.h, cut to where the profile's polynomials end. */
static double bend(const struct rim_case *of, const struct place *at)
{
    const double y = fmax(-CURVE_Y_MAX_Q14, fmin(CURVE_Y_MAX_Q14, at->y * 16384)) / 16384;
    const double tau = fmax(-2, fmin(2, at->tau));
    const int32_t *c = of->curve_q14;
    const double a[5] = {c[0] + y * (c[1] + y * (c[2] + y * c[3])),
                         c[4] + y * (c[5] + y * (c[6] + y * c[7])),
                         c[8] + y * (c[9] + y * (c[10] + y * c[11])), c[12] + y * c[13], c[14]};
    const double sum = a[0] + tau * (a[1] + tau * (a[2] + tau * (a[3] + tau * a[4])));
    return fmax(-sqrt(8), fmin(sqrt(8), tau + of->eps * at->h * sum / 16384));
}

static struct row row_of(const struct rim_case *of, const struct place *at, double t, int32_t p_q14,
                         int32_t q_q14, int grey_q4)
{
    const struct rimrow_view *view = &of->view;
    const double edge = view->edge_q14 / 16384.0;
    const double y = fmax(-CURVE_Y_MAX_Q14, fmin(CURVE_Y_MAX_Q14, at->y * 16384)) / 16384;
    const double n = fmax(0, ldexp(view->peak_n0 - view->peak_n1 * y, (int)view->peak_shift - 15));
    const double peak = of->peak * exp(-fmin(8, at->square * n));
    double e = edge * normal(t) + peak * fmax(normal(t), view->peak_shown_q15 / 32767.0);
    double blur = -t * edge * bell(t);
    for (unsigned k = 0; k < view->edge_count; k++) {
        e += of->over_rim * normal(-at->apart[k]);
        blur += of->over_rim * at->apart[k] * bell(at->apart[k]);
    }
    const double p = p_q14 / 16384.0;
    const double q = q_q14 / 16384.0;
    const double level = view->level_q5 + view->level_p_q5 * p + view->level_q_q5 * q;
    const double contrast = view->contrast_q2 + view->contrast_p_q2 * p + view->contrast_q_q2 * q;
    const double rest = ldexp(grey_q4 * 32.0 - level - 8 * contrast * e, -(int)view->rest_shift);
    const double push = edge * bell(t) * at->h;
    return (struct row){{2048 * push * at->cos1, 2048 * push * at->sin1, 2048 * push,
                         2048 * push * at->cos2, 2048 * push * at->sin2, 2048, 2048 * e, 2048 * blur,
                         fmax(-4095, fmin(4095, rest))}};
}

/* How far fixed-point places are off at most. */
struct slack {
    double tau;
    double h;
    double y;
    double direction; /* cos and sin, of the single or double angle */
    double t;         /* what bend's own steps add */
};

static struct slack slack_of(const struct rim_case *of, const struct place *at)
{
    const struct rimrow_view *view = &of->view;
    struct slack off;
    /* 1 / rho is good to 4e-5; cos and sin are cut to Q14, and their product doubles that. The columns' double angle
     * is made from these again, in Q13. */
    const double single = 4e-5 + 0x1p-14;
    const double doubled = 2 * sqrt(2) * single + 0x1p-14;
    off.direction = doubled + 0x1p-13;
    const double swing = ldexp(hypot(view->inverse_cos_q14, view->inverse_sin_q14), (int)view->wide - 14);
    const double digit = ldexp(1, (int)view->wide - 13); /* the last one of (R / h)^2 */
    off.y = swing * off.direction + digit;
    /* 1 / sqrt by a polynomial good to 8e-5 with 8 terms and 7 products, each rounded to Q14, of what is at least a
     * half; then Q13. */
    off.h = at->h * at->h * at->h / 2 * off.y + (8e-5 + 15 * 0x1p-15) * at->h + 0x1p-14;
    /* 1 - rho is cut to Q24 and by depth_shift, its product with R / s to Q13 or Q12, that with h rounded to Q11 or
     * Q10. */
    const double over_blur = ldexp(view->depth_q14, -3 - (int)view->depth_shift);
    const double unit = ldexp(1, (int)view->depth_shift - 24);
    off.tau = (over_blur * (unit + 4 * 0x1p-24) + digit) * at->h + fabs(at->tau) / at->h * off.h + 2 * digit;
    /* Coefficients and each product of Horner's rule are rounded to Q11, so that a cubic errs by twice
     * (1 + y/2 + ...) halves of that, and the sum by (1 + tau/2 + ...) times that and one more. Then comes the product
     * with eps h, rounded to Q15 by the shift, to Q13 by the shift, and half of tau. */
    const double y = fabs(at->y) / 2;
    const double tau = fmin(2, fabs(at->tau)) / 2;
    const double cubic = 2 * (1 + y * (1 + y * (1 + y)));
    const double sum = (cubic + 1) * (1 + tau * (1 + tau * (1 + tau * (1 + tau)))) * 0x1p-12;
    off.t = of->eps * at->h * sum +
            ldexp(4 * (at->h * 0x1p-15 + 0x1p-16) + 0x1p-14, (int)view->bend_shift) + 0x1p-13;
    return off;
}

/* The most that each entry changes when the places move by their slack; and its own roundings. */
static struct row tolerance_of(const struct rim_case *of, const struct place *at,
                               const struct slack *off, int32_t p_q14, int32_t q_q14, int grey_q4)
{
    const struct rimrow_view *view = &of->view;
    const struct row middle = row_of(of, at, bend(of, at), p_q14, q_q14, grey_q4);
    struct row most = {{0}};
    for (unsigned signs = 0; signs < 16; signs++) {
        struct place moved = *at;
        moved.tau += signs & 1 ? off->tau : -off->tau;
        moved.h += signs & 2 ? off->h : -off->h;
        moved.y += signs & 4 ? off->y : -off->y;
        for (unsigned k = 0; k < view->edge_count; k++) {
            moved.apart[k] -= 0x1p-11; /* cut to Q11 */
        }
        const double t = bend(of, &moved) + (signs & 8 ? off->t : -off->t);
        const struct row other = row_of(of, &moved, t, p_q14, q_q14, grey_q4);
        for (unsigned k = 0; k < RIMROW_COLUMNS; k++) {
            most.at[k] = fmax(most.at[k], fabs(other.at[k] - middle.at[k]));
        }
    }
    /* The edge: polynomials of 7 terms, each rounded, as is each product, to Q15 (13 halves of that: 2.0e-4); they are
     * off by 3.1e-5 (phi), and w, made of t^2 in Q11, by 2^-14, which is another 5e-5. Phi has t / 2 times as much, up
     * to 1.42, and its last digit is of Q14. */
    const double bell_off = 3.1e-5 + 13 * 0x1p-16 + 5e-5;
    const double edge_off = 1.42 * (13 * 0x1p-16 + 5e-6) + 5e-5 + 0x1p-14;
    /* n has y's error times n1 and its own last digits; rho^2, cut to Q12, times n below 16 is rounded to Q12 and more
     * where n is large. */
    const double narrow_off = ldexp(view->peak_n1, (int)view->peak_shift - 15) * off->y +
                              3 * ldexp(1, (int)view->peak_shift - 15);
    const double exponent_off = at->square * narrow_off + ldexp(1, (int)view->peak_shift - 13) + 16 * 0x1p-12;
    /* What falls: a polynomial of 6 terms to the fourth, 4 times 0.8^3 of its error at most. The tail is that times
     * Mills' ratio, which is off by 6e-4 and 15 halves of Q14, of at most 0.4; then Q14. */
    const double fall_off = 4 * 0.512 * (1.5e-5 + 11 * 0x1p-16) + 4 * 0x1p-16;
    const double tail_off = 0.4 * (6e-4 + 15 * 0x1p-15) + 1.2533 * fall_off + 0x1p-15;
    const double edge = view->edge_q14 / 16384.0;
    const double others = of->over_rim * view->edge_count;
    const double push_off = 2048 * bell_off * edge * at->h + 1.5;
    for (unsigned k = 0; k < 5; k++) {
        most.at[k] += push_off + fabs(middle.at[2]) * off->direction;
    }
    /* Gains end in Q14, from a mantissa of Q15, by their shift. */
    const double unit = 0x1p-14 * (ldexp(1, view->peak.up) + ldexp(1, view->over_rim.up) + 2);
    const double e_off = edge_off * (edge + of->peak) + of->peak * (fall_off / 0.3989 + exponent_off) +
                         tail_off * others + unit;
    most.at[6] += 2048 * e_off + 0.5;
    most.at[7] += 2048 * (bell_off * 2 * edge + 4 * fall_off * others + 2 * unit) + 1;
    /* The model is cut three times in Q5 units: level, contrast (Q2: 8) and their sum; and the shift once. */
    const double contrast = abs(view->contrast_q2) + 3.5 * (abs(view->contrast_p_q2) +
                                                             abs(view->contrast_q_q2));
    most.at[8] += ldexp(8 * contrast * e_off + 2 + 8 * 2, -(int)view->rest_shift) + 1;
    return most;
}

/* 1: must be kept, -1: must not be, 0: too near to a limit to say. */
static int keeping_of(const struct rim_case *of, const struct place *at, const struct slack *off,
                      double e, double blur)
{
    const struct rimrow_view *view = &of->view;
    const double outwards = fmax(view->gap_q11 / 2048.0 * at->h - view->clear_q11 / 2048.0,
                                 view->near_q11 / 2048.0);
    /* The gap's product with h is rounded to Q9; tau is cut to Q11 beside it. */
    const double outwards_off = view->gap_q11 / 2048.0 * off->h + 0x1p-10 + 0x1p-11;
    double room = fmin(2 - fabs(at->tau), outwards + at->tau - outwards_off) - off->tau;
    double least = fmin(2 - fabs(at->tau), outwards + at->tau + outwards_off) + off->tau;
    for (unsigned k = 0; k < view->edge_count; k++) {
        room = fmin(room, at->apart[k] - 0x1p-11);
        least = fmin(least, at->apart[k] + 0x1p-11);
    }
    /* E and its change by blur at most 2, which the profiles tested come near to only together with 1 %. */
    room = fmin(room, 1.98 - fmax(e, fabs(blur)));
    least = fmin(least, 2.02 - fmax(e, fabs(blur)));
    if (at->square < 0.125 || at->square >= 8) {
        return -1;
    }
    return room > 0 ? 1 : least < 0 ? -1 : 0;
}

static unsigned kept_count;
static unsigned left_count;

static void check_pixel(const struct rim_case *of, unsigned i)
{
    const int32_t p_q14 = batch.p_q14[i];
    const int32_t q_q14 = batch.q_q14[i];
    const struct place at = place_of(&of->view, p_q14, q_q14);
    const struct slack off = slack_of(of, &at);
    const struct row expected = row_of(of, &at, bend(of, &at), p_q14, q_q14, batch.grey_q4[i]);
    const bool kept = batch.octant[i] < 8;
    const int keeping = keeping_of(of, &at, &off, expected.at[6] / 2048, expected.at[7] / 2048);
    TEST_ASSERT_TRUE(keeping == 0 || kept == (keeping > 0));
    if (!kept) {
        for (unsigned k = 0; k < RIMROW_COLUMNS; k++) {
            TEST_ASSERT_EQUAL_INT16(0, batch.columns[k * RIMROW_PIXELS + i]);
        }
        TEST_ASSERT_EQUAL_INT16(8, batch.octant[i]);
        left_count++;
        return;
    }
    const struct row tolerance =
        tolerance_of(of, &at, &off, p_q14, q_q14, batch.grey_q4[i]);
    for (unsigned k = 0; k < RIMROW_COLUMNS; k++) {
        SYNTH_NEAR(tolerance.at[k], expected.at[k], batch.columns[k * RIMROW_PIXELS + i]);
    }
    /* Told by directions in Q14: where two octants meet either is right. */
    const bool between = fabs(fabs(at.cos1) - fabs(at.sin1)) < 4 * off.direction ||
                         fmin(fabs(at.cos1), fabs(at.sin1)) < 2 * off.direction;
    const int octant = (p_q14 < 0 ? 1 : 0) + (q_q14 < 0 ? 2 : 0) +
                       (abs(p_q14) < abs(q_q14) ? 4 : 0);
    TEST_ASSERT_TRUE(between || octant == batch.octant[i]);
    kept_count++;
}

/* Pixels in the band and a quarter of it beyond. */
static void check_view(const struct rim_case *of, uint64_t *seed)
{
    const struct rimrow_view *view = &of->view;
    for (unsigned i = 0; i < RIMROW_PIXELS; i++) {
        const double angle = within(seed, 0, 2 * SYNTH_PI);
        const double v = ldexp(view->inverse_q13, (int)view->wide - 13) +
                         inverse_swing(view, cos(2 * angle), sin(2 * angle));
        const double rho =
            1 + within(seed, -2.5, 2.5) * of->eps * sqrt(v);
        const double cut = fmax(0.05, fmin(3.49, rho));
        batch.p_q14[i] = (int32_t)lrint(cut * cos(angle) * 16384);
        batch.q_q14[i] = (int32_t)lrint(cut * sin(angle) * 16384);
        batch.grey_q4[i] = (uint16_t)(synth_u64(seed) % 4096);
    }
    dsp_scalar.rim_rows(view, RIMROW_PIXELS, &batch);
    for (unsigned i = 0; i < RIMROW_PIXELS; i++) {
        check_pixel(of, i);
    }
}

static void plain_discs_of_every_shape_and_blur_agree_with_double(void)
{
    uint64_t seed = 81;
    kept_count = left_count = 0;
    for (unsigned round = 0; round < 400; round++) {
        const struct rim_case of =
            make_case(within(&seed, 0.2, 1), within(&seed, 0, 6.3), exp(within(&seed, 0.06, 7)));
        check_view(&of, &seed);
    }
    TEST_ASSERT_TRUE(kept_count > 200 * RIMROW_PIXELS && left_count > 40 * RIMROW_PIXELS);
}

static void rests_know_slopes_of_level_and_contrast(void)
{
    uint64_t seed = 82;
    kept_count = 0;
    for (unsigned round = 0; round < 200; round++) {
        struct rim_case of =
            make_case(within(&seed, 0.3, 1), within(&seed, 0, 6.3), exp(within(&seed, 0.2, 4)));
        of.view.rest_shift = round % 2 ? 5 : 0;
        of.view.level_p_q5 = (int32_t)within(&seed, -9000, 9000);
        of.view.level_q_q5 = (int32_t)within(&seed, -9000, 9000);
        of.view.contrast_p_q2 = (int32_t)within(&seed, -2000, 2000);
        of.view.contrast_q_q2 = (int32_t)within(&seed, -2000, 2000);
        check_view(&of, &seed);
    }
    TEST_ASSERT_TRUE(kept_count > 100 * RIMROW_PIXELS);
}

static void peaks_and_neighbouring_edges_are_in_the_profile(void)
{
    uint64_t seed = 83;
    kept_count = left_count = 0;
    for (unsigned round = 0; round < 400; round++) {
        const double over_blur = exp(within(&seed, 0.2, 3));
        struct rim_case of = make_case(within(&seed, 0.4, 1), within(&seed, 0, 6.3), over_blur);
        of.view.edge_q14 = (int16_t)within(&seed, 6000, 16384);
        set_peak(&of, within(&seed, 0, 0.9));
        const double n0 = within(&seed, 0.5, 4);
        rimrow_set_fall(&of.view, llround(32768 * n0), llround(32768 * within(&seed, 0, 0.3)));
        of.view.peak_shown_q15 = round % 2 ? INT16_MAX : 0;
        set_over_rim(&of, within(&seed, 1, 1.5));
        of.view.edge_count = round % (RIMROW_EDGES + 1);
        for (unsigned k = 0; k < of.view.edge_count; k++) {
            /* Lines around the circle, at two radii or nearer; |tp|, |tq| <= 2^14 in Q7. */
            const double angle = 2.1 * k + within(&seed, 0, 1);
            of.view.edges[k] = (struct rimrow_edge){
                (int32_t)(2048 * over_blur * within(&seed, 1, 2)),
                (int32_t)(128 * over_blur * cos(angle)), (int32_t)(128 * over_blur * sin(angle))};
        }
        of.view.clear_q11 = round % 3 ? 307 * 8 : 563 * 8;
        of.view.gap_q11 = (int16_t)(2048 * fmin(15.9, over_blur * within(&seed, 0.1, 1)));
        of.view.near_q11 = (int16_t)(2048 * within(&seed, 0.1, 1));
        check_view(&of, &seed);
    }
    TEST_ASSERT_TRUE(kept_count > 100 * RIMROW_PIXELS && left_count > 80 * RIMROW_PIXELS);
}

/* [1/8, 8) of rho^2 is told exactly, for the sum of squares is exact. Blur as large as the circle has both ends
 * within two blurs. */
static void range_of_radii_is_exact(void)
{
    const struct rimrow_view view = make_case(1, 0, 1).view;
    static const int32_t small = 4096; /* 1/4 */
    const int64_t ends[2] = {(int64_t)1 << 25, (int64_t)1 << 31};
    for (unsigned end = 0; end < 2; end++) {
        for (int32_t step = -2; step <= 2; step++) {
            const int32_t q_q14 = (int32_t)sqrt((double)(ends[end] - (int64_t)small * small)) + step;
            const int64_t square = (int64_t)small * small + (int64_t)q_q14 * q_q14;
            setUp();
            batch.p_q14[0] = small;
            batch.q_q14[0] = -q_q14;
            dsp_scalar.rim_rows(&view, RIMROW_STEP, &batch);
            TEST_ASSERT_EQUAL_INT(square >= ends[0] && square < ends[1], batch.octant[0] < 8);
            TEST_ASSERT_EQUAL_INT16(8, batch.octant[1]); /* p = q = 0 */
        }
    }
    /* sqrt(8) 2^14 itself is no integer, but p = q = 2 is. */
    batch.p_q14[0] = batch.q_q14[0] = 1 << 15;
    dsp_scalar.rim_rows(&view, RIMROW_STEP, &batch);
    TEST_ASSERT_EQUAL_INT16(8, batch.octant[0]);
}

/* Inwards the band; outwards what gap, clear and near leave. Along an axis of a circle: h = R. */
static void band_ends_where_it_should(void)
{
    struct rimrow_view view = make_case(1, 0, 8).view;
    view.band_q14 = 3 << 13; /* 1.5 */
    view.near_q11 = 1 << 10; /* 0.5 */
    view.gap_q11 = 2 << 11;
    view.clear_q11 = 5 << 9; /* 1.25: 0.75 are left */
    /* tau in steps of 8 / 2^14 = 2^-11 a place. The slack is that of slack_of: 4 steps. */
    static const struct {
        double tau;
        bool   kept;
    } ends[] = {{1.5 - 0x1p-9, true}, {1.5 + 0x1p-9, false}, {-0.75 + 0x1p-9, true}, {-0.75 - 0x1p-9, false}};
    for (unsigned i = 0; i < 4; i++) {
        batch.p_q14[i] = (int32_t)lrint((1 - ends[i].tau / 8) * 16384);
        batch.q_q14[i] = 0;
    }
    dsp_scalar.rim_rows(&view, RIMROW_STEP, &batch);
    for (unsigned i = 0; i < 4; i++) {
        TEST_ASSERT_EQUAL_INT(ends[i].kept, batch.octant[i] < 8);
    }
    view.clear_q11 = 2 << 11; /* nothing is left: near counts */
    batch.p_q14[2] = (int32_t)lrint((1 + (0.5 - 0x1p-9) / 8) * 16384);
    batch.p_q14[3] = (int32_t)lrint((1 + (0.5 + 0x1p-9) / 8) * 16384);
    dsp_scalar.rim_rows(&view, RIMROW_STEP, &batch);
    TEST_ASSERT_TRUE(batch.octant[2] < 8);
    TEST_ASSERT_EQUAL_INT16(8, batch.octant[3]);
}

/* One of the two bounds, or between them. */
static int32_t any(uint64_t *seed, int32_t low, int32_t high)
{
    const uint64_t pick = synth_u64(seed) % 4;
    return pick == 0 ? low : pick == 1 ? high : (int32_t)within(seed, low, high);
}

/* Everything at the bounds of rimrow.h: with SAN=1 an overflow ends the program. Entries stay below the bound of
 * the products (dsp.h). */
static void extremes_of_the_ranges_do_not_overflow(void)
{
    uint64_t seed = 84;
    for (unsigned round = 0; round < 1000; round++) {
        const double alpha = round % 3 ? within(&seed, 0.1255, 1) : 0.1255;
        const double over_blur = exp(within(&seed, 0, round % 2 ? 0.5 : 8));
        struct rimrow_view view = make_case(alpha, within(&seed, 0, 6.3), over_blur).view;
        view.gap_q11 = (int16_t)any(&seed, 0, INT16_MAX);
        view.near_q11 = (int16_t)any(&seed, 0, 15 << 11);
        view.over_rim = rimrow_gain_of(any(&seed, 1 << 24, 16 << 24));
        view.level_q5 = any(&seed, -(1 << 19), 1 << 19);
        view.level_p_q5 = any(&seed, -(1 << 14), 1 << 14);
        view.level_q_q5 = any(&seed, -(1 << 14), 1 << 14);
        view.contrast_q2 = any(&seed, -(1 << 14), 1 << 14);
        view.contrast_p_q2 = any(&seed, -(1 << 12), 1 << 12);
        view.contrast_q_q2 = any(&seed, -(1 << 12), 1 << 12);
        view.rest_shift = round % 2 ? 0 : 5;
        view.edge_q14 = (int16_t)any(&seed, 0, (2 << 14) - 1);
        view.peak = rimrow_gain_of(any(&seed, 0, 40 << 24));
        rimrow_set_fall(&view, any(&seed, 0, 17 << 15), any(&seed, 0, 17 << 15));
        view.peak_shown_q15 = round % 2 ? INT16_MAX : 0;
        view.edge_count = round % (RIMROW_EDGES + 1);
        view.edge_shift = (uint32_t)any(&seed, 2, 14);
        for (unsigned k = 0; k < RIMROW_EDGES; k++) {
            view.edges[k] = (struct rimrow_edge){any(&seed, -(1 << 22), 1 << 22),
                                                 any(&seed, -(1 << 14), 1 << 14),
                                                 any(&seed, -(1 << 14), 1 << 14)};
        }
        for (unsigned i = 0; i < RIMROW_PIXELS; i++) {
            const double rho = i % 4 ? within(&seed, 0, 3.4999) : 1;
            const double angle = i % 8 ? within(&seed, 0, 6.3) : SYNTH_PI / 4 * (i % 64 / 8);
            batch.p_q14[i] = (int32_t)(rho * cos(angle) * 16384);
            batch.q_q14[i] = (int32_t)(rho * sin(angle) * 16384);
            batch.grey_q4[i] = (uint16_t)any(&seed, 0, 4095);
        }
        dsp_scalar.rim_rows(&view, RIMROW_PIXELS, &batch);
        for (unsigned i = 0; i < RIMROW_COLUMNS * RIMROW_PIXELS; i++) {
            TEST_ASSERT_TRUE(batch.columns[i] >= -4095 && batch.columns[i] <= 4095);
            TEST_ASSERT_TRUE(batch.octant[i % RIMROW_PIXELS] < 8 || batch.columns[i] == 0);
        }
    }
}

static void octants_add_up_squares_and_pixels(void)
{
    uint64_t seed = 85;
    double squares[8] = {0};
    uint32_t counts[8] = {0};
    for (unsigned i = 0; i < RIMROW_PIXELS; i++) {
        batch.octant[i] = (int16_t)(synth_u64(&seed) % 9);
        const int16_t rest = (int16_t)any(&seed, -4095, 4095);
        batch.columns[(RIMROW_COLUMNS - 1) * RIMROW_PIXELS + i] = rest;
        if (batch.octant[i] < 8) {
            squares[batch.octant[i]] += (double)rest * rest;
            counts[batch.octant[i]]++;
        }
    }
    uint32_t found_squares[8];
    uint32_t found_counts[8];
    dsp_scalar.rim_octants(&batch, RIMROW_PIXELS, found_squares, found_counts);
    TEST_ASSERT_EQUAL_UINT32_ARRAY(counts, found_counts, 8);
    for (unsigned k = 0; k < 8; k++) {
        TEST_ASSERT_TRUE(squares[k] == found_squares[k]);
    }
}

static void span_rounds_each_place_and_widens_bytes(void)
{
    struct rimrow_steps steps;
    for (int i = 0; i <= RIMROW_RAMP; i++) {
        steps.p_q24[i] = 54321 * i;
        steps.q_q24[i] = -1024 * i;
    }
    uint8_t bytes[24];
    for (unsigned i = 0; i < sizeof bytes; i++) {
        bytes[i] = (uint8_t)(255 - i);
    }
    batch.grey_q4[24] = 77;
    dsp_scalar.rim_span(&steps, -1000000, 512, bytes, 21, batch.p_q14, batch.q_q14, batch.grey_q4);
    for (int x = 0; x < 24; x++) { /* up to a whole multiple of RIMROW_RAMP */
        TEST_ASSERT_EQUAL_INT32((int32_t)floor((-1000000 + 54321.0 * x) / 1024 + 0.5), batch.p_q14[x]);
        TEST_ASSERT_EQUAL_INT32(1 - x, batch.q_q14[x]);
        TEST_ASSERT_EQUAL_UINT16(16 * (255 - x), batch.grey_q4[x]);
    }
    TEST_ASSERT_EQUAL_INT32(0, batch.p_q14[24]);
    TEST_ASSERT_EQUAL_UINT16(77, batch.grey_q4[24]);
    dsp_scalar.rim_span(&steps, 0, 0, NULL, 24, batch.p_q14, batch.q_q14, batch.grey_q4 + 24);
    TEST_ASSERT_EQUAL_UINT16(77, batch.grey_q4[24]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(plain_discs_of_every_shape_and_blur_agree_with_double);
    RUN_TEST(rests_know_slopes_of_level_and_contrast);
    RUN_TEST(peaks_and_neighbouring_edges_are_in_the_profile);
    RUN_TEST(range_of_radii_is_exact);
    RUN_TEST(band_ends_where_it_should);
    RUN_TEST(extremes_of_the_ranges_do_not_overflow);
    RUN_TEST(octants_add_up_squares_and_pixels);
    RUN_TEST(span_rounds_each_place_and_widens_bytes);
    return UNITY_END();
}
