/* See rim.h. Unit-frame coordinates are Q24, directions Q20, Jacobian entries Q11, rests 13 bits. Shifts
 * that truncate do so in the last of 20 bits and more; the numbers of 11 bits are rounded. */
#include "firmware/detect/rim.h"

#include "common/fx/fx.h"
#include "common/fx/root.h"
#include "firmware/detect/luma.h"
#include "firmware/detect/profile.h"

#define BAND_SIGMAS_Q8  512   /* 2 */
/* How near, in blurs, to the triangle's edges: as far in every direction, for what the model of a small
 * circle's rim lacks is the same all around, and must not be seen on one side only. */
#define CLEAR_SIGMAS_Q8 563   /* 2.2: an edge farther off adds less than 1.4 % */
#define CLEAR_KNOWN_Q8  307   /* 1.2: where the edges are part of the model */
#define BAND_MIN_PX_Q16 45875 /* 0.7 */
/* Rows and columns are visited so much beyond the band; the band itself is then exact. */
#define SPAN_MARGIN_PX_Q16 8192
#define REST            RIM_UNKNOWNS
#define REST_LIMIT      4095
/* Below 2 in Q11 after rounding: what the products' kernel takes. */
#define ENTRY_LIMIT_Q20 ((2 << 20) - 1024)
#define PEAK_LIMIT_Q15  ((2 << 15) - 64)
/* The first pass, which the second corrects, takes every second row of circles of this size, and of large
 * ones so many that ten or more cross the circle. */
#define THIN_MIN_PX_Q16 (5 << 16)
#define THIN_SHARE_PX_Q16 (5 << 16)
#define THIN_STEP_MAX   6

static_assert(DSP_COLUMNS == RIM_UNKNOWNS + 1, "a Jacobian's row and the rest");

/* What all pixels of a view share. */
struct band {
    int64_t inside_px_q16;    /* 2 s */
    int64_t clear_px_q16;     /* 2.2 s, or 1.2 s */
    int64_t over_blur_q24;    /* 1 / s: 2^40 / blur_px_q16 */
    int64_t over_edge_blur_q24;
    int64_t outer_square_q16; /* rho^2 within which the whole band lies */
    int64_t inner_square_q16; /* and without; 0: the centre may be in it */
    bool    within_range;     /* (R / h)^2 is nowhere too small or large to be looked up */
};

static struct band make_band(const struct rim_view *view)
{
    struct band band = {
        .inside_px_q16 = ((int64_t)view->blur_px_q16 * BAND_SIGMAS_Q8) >> 8,
        .clear_px_q16 = ((int64_t)view->blur_px_q16 *
                         (view->edges.known ? CLEAR_KNOWN_Q8 : CLEAR_SIGMAS_Q8)) >> 8,
        .over_blur_q24 = ((int64_t)1 << 40) / view->blur_px_q16,
        .over_edge_blur_q24 =
            view->edges.known ? ((int64_t)1 << 40) / view->edge_blur_px_q16 : 0,
    };
    /* R over the semi-axes: (R / h)^2 is i0 +- root(i1^2 + i2^2) at its ends; a percent to the safe side. */
    const int64_t i0 = view->inverse_q24[0];
    const int64_t i1 = view->inverse_q24[1] >> 8;
    const int64_t i2 = view->inverse_q24[2] >> 8;
    const int64_t swing_q24 = (int64_t)root_u64((uint64_t)(i1 * i1 + i2 * i2)) << 8;
    /* Directions are good to 2^-14, a share that the bounds leave room for. */
    band.within_range = i0 - swing_q24 > 1 << 16 && i0 + swing_q24 < (int64_t)1 << 31;
    const int64_t most = band.within_range ? i0 + swing_q24 : 1 << 24;
    const int64_t least = band.within_range ? i0 - swing_q24 : 1 << 24;
    const int64_t over_minor_q24 = profile_root_q24((uint32_t)most) * (int64_t)101 / 100;
    const int64_t over_major_q24 = profile_root_q24((uint32_t)least) * (int64_t)99 / 100;
    const int64_t share_q16 = ((int64_t)1 << 32) / view->size_px_q16; /* 1 px over R */
    const int64_t per_px_q16 = (share_q16 * over_minor_q24) >> 24;    /* rho a pixel, at most */
    const int64_t least_per_px_q16 = (share_q16 * over_major_q24) >> 24;
    const int64_t inwards_q16 = (band.inside_px_q16 * per_px_q16) >> 16;
    const int64_t nearest_q16 = (BAND_MIN_PX_Q16 * per_px_q16) >> 16;
    int64_t outwards_q16 = view->gap_q16 - ((band.clear_px_q16 * least_per_px_q16) >> 16);
    outwards_q16 = outwards_q16 < nearest_q16 ? nearest_q16 : outwards_q16;
    outwards_q16 = outwards_q16 > inwards_q16 ? inwards_q16 : outwards_q16;
    const int64_t outer_q16 = 65536 + (outwards_q16 < 2 << 16 ? outwards_q16 : 2 << 16);
    const int64_t inner_q16 = inwards_q16 < 65536 ? 65536 - inwards_q16 : 0;
    band.outer_square_q16 = (outer_q16 * outer_q16) >> 16;
    band.inner_square_q16 = (inner_q16 * inner_q16) >> 16;
    return band;
}

static inline int64_t peak_q15(const struct rim *rim, uint32_t square_q24)
{
    const uint32_t i = square_q24 >> 17;
    const int64_t rest_q17 = square_q24 & 0x1ffffu;
    const int64_t step = (int64_t)rim->peak_q15[i + 1] - rim->peak_q15[i];
    return rim->peak_q15[i] + ((step * rest_q17) >> 17);
}

static inline int16_t round_q11(int64_t value, unsigned shift)
{
    return (int16_t)fx_round_shift_i64(value, shift);
}

/* What the triangle's edges add at one pixel, in full swings from black to white, Q15, and how that grows with
 * the logarithm of the blur. False beyond an edge. */
static inline bool add_edges(const struct rim_view *view, const struct band *band,
                             int64_t x_px_q16, int64_t y_px_q16, int64_t *swing_q15,
                             int64_t *growth_q15)
{
    for (unsigned i = 0; i < view->edges.count; i++) {
        const struct pattern_edge *edge = &view->edges.at[i];
        const int64_t inside_px_q16 = (edge->nx_q15 * (x_px_q16 - edge->x_px_q16) +
                                       edge->ny_q15 * (y_px_q16 - edge->y_px_q16)) >> 15;
        if (inside_px_q16 < 0) {
            return false;
        }
        const int64_t t_q16 = (inside_px_q16 * band->over_edge_blur_q24) >> 24;
        if (t_q16 < (int64_t)4 << 16) {
            int32_t bell_q15;
            *swing_q15 += 32768 - profile_edge((int32_t)t_q16, &bell_q15);
            *growth_q15 += (t_q16 * bell_q15) >> 16;
        }
    }
    return true;
}

/* What one pixel of brightness `grey_q4` at unit-frame place (p, q), (x, y) in the image, says, into the
 * columns at `at`; false when it is not in the band. */
static inline bool read_pixel(const struct rim *rim, const struct rim_view *view,
                              const struct band *band, int64_t p_q24, int64_t q_q24,
                              int64_t x_px_q16, int64_t y_px_q16, uint16_t grey_q4, int16_t *at,
                              struct rim_sums *sums)
{
    const uint64_t square = (uint64_t)(p_q24 * p_q24 + q_q24 * q_q24) >> 24;
    if (square - (1 << 18) > (uint64_t)9 << 24) { /* also when below 2^18 */
        return false;
    }
    /* Directions: cos and sin of the single and double angle. */
    const int64_t over_q16 = profile_inverse_q16((uint32_t)square);
    const int64_t rho_q24 = ((int64_t)square * over_q16) >> 16;
    const int64_t cos_q20 = (p_q24 * over_q16) >> 20;
    const int64_t sin_q20 = (q_q24 * over_q16) >> 20;
    const int64_t cos2_q20 = (cos_q20 * cos_q20 - sin_q20 * sin_q20) >> 20;
    const int64_t sin2_q20 = (cos_q20 * sin_q20) >> 19;
    const int64_t inverse_q24 =
        view->inverse_q24[0] +
        ((view->inverse_q24[1] * cos2_q20 + view->inverse_q24[2] * sin2_q20) >> 20);
    const int64_t h_q16 = profile_inverse_q16((uint32_t)inverse_q24); /* h / R */
    /* Distance inside the edge. */
    const int64_t h_px_q16 = (h_q16 * view->size_px_q16) >> 16;
    const int64_t d_px_q16 = ((((int64_t)1 << 24) - rho_q24) * h_px_q16) >> 24;
    int64_t outside_px_q16 = ((h_px_q16 * view->gap_q16) >> 16) - band->clear_px_q16;
    outside_px_q16 = outside_px_q16 < BAND_MIN_PX_Q16 ? BAND_MIN_PX_Q16 : outside_px_q16;
    if (d_px_q16 > band->inside_px_q16 || -d_px_q16 > band->inside_px_q16 ||
        -d_px_q16 > outside_px_q16) {
        return false;
    }
    int64_t swing_q15 = 0;
    int64_t growth_q15 = 0;
    if (view->edges.known &&
        !add_edges(view, band, x_px_q16, y_px_q16, &swing_q15, &growth_q15)) {
        return false;
    }
    const int64_t t_q16 = (d_px_q16 * band->over_blur_q24) >> 24;
    int32_t bell_plain_q15;
    int64_t edge_q15 = profile_edge((int32_t)t_q16, &bell_plain_q15);
    int64_t bell_q15 = bell_plain_q15;
    if (square < (uint64_t)1 << 24) {
        const int64_t peak = peak_q15(rim, (uint32_t)square);
        if (peak > PEAK_LIMIT_Q15) {
            return false; /* the middle of a target whose circles have faint rims */
        }
        edge_q15 = (edge_q15 * peak) >> 15;
        bell_q15 = (bell_q15 * peak) >> 15;
    }
    /* Beyond an edge lies the circle's own colour in full. */
    edge_q15 += (swing_q15 * rim->over_rim_q15) >> 15;
    const int64_t blur_q15 = -((t_q16 * bell_q15) >> 16) + ((growth_q15 * rim->over_rim_q15) >> 15);
    if (edge_q15 > PEAK_LIMIT_Q15 || fx_abs_i64(blur_q15) > PEAK_LIMIT_Q15) {
        return false;
    }
    /* Entries below 2. */
    int64_t push_q20 = (bell_q15 * h_q16) >> 11;
    push_q20 = push_q20 < ENTRY_LIMIT_Q20 ? push_q20 : ENTRY_LIMIT_Q20;
    at[0 * DSP_BATCH] = round_q11(push_q20 * cos_q20, 29);
    at[1 * DSP_BATCH] = round_q11(push_q20 * sin_q20, 29);
    at[2 * DSP_BATCH] = round_q11(push_q20, 9);
    at[3 * DSP_BATCH] = round_q11(push_q20 * cos2_q20, 29);
    at[4 * DSP_BATCH] = round_q11(push_q20 * sin2_q20, 29);
    at[RIM_LEVEL * DSP_BATCH] = 1 << 11;
    at[RIM_CONTRAST * DSP_BATCH] = round_q11(edge_q15, 4);
    at[RIM_BLUR * DSP_BATCH] = round_q11(blur_q15, 4);
    int64_t rest = grey_q4;
    if (view->fine) {
        /* What is left is a few grey levels; beyond 1/32 of the range it is cut. */
        const int64_t dx_q16 = x_px_q16 - view->ellipse.x_px_q16;
        const int64_t dy_q16 = y_px_q16 - view->ellipse.y_px_q16;
        const int64_t level_q30 =
            view->level_q30 + ((view->level_slope_q30[0] * dx_q16 +
                                view->level_slope_q30[1] * dy_q16) >> 16);
        const int64_t contrast_q30 =
            view->contrast_q30 + ((view->contrast_slope_q30[0] * dx_q16 +
                                   view->contrast_slope_q30[1] * dy_q16) >> 16);
        const int64_t model_q30 = level_q30 + ((contrast_q30 * edge_q15) >> 15);
        rest = fx_round_shift_i64(((int64_t)grey_q4 << 18) - model_q30, 13);
        rest = rest > REST_LIMIT ? REST_LIMIT : rest;
        rest = rest < -REST_LIMIT ? -REST_LIMIT : rest;
        const unsigned octant = (p_q24 < 0 ? 1u : 0u) + (q_q24 < 0 ? 2u : 0u) +
                                (fx_abs_i64(p_q24) < fx_abs_i64(q_q24) ? 4u : 0u);
        sums->octant_squares_q44[octant] += rest * rest * (1 << 22);
        sums->octant_count[octant]++;
    }
    at[REST * DSP_BATCH] = (int16_t)rest;
    return true;
}

/* Pixels read and not summed yet, and the sums of products so far. */
struct batch {
    int64_t          products[DSP_PRODUCTS];
    uint32_t         waiting;
    struct rim_sums *sums;
};

static void sum_batch(const struct rim *rim, struct batch *batch)
{
    const uint32_t whole = (batch->waiting + DSP_BATCH_STEP - 1) / DSP_BATCH_STEP * DSP_BATCH_STEP;
    for (unsigned column = 0; column < DSP_COLUMNS; column++) {
        for (uint32_t i = batch->waiting; i < whole; i++) {
            rim->columns[column * DSP_BATCH + i] = 0;
        }
    }
    rim->dsp->products(rim->columns, whole, batch->products);
    batch->sums->count += batch->waiting;
    batch->waiting = 0;
}

/* Reads the pixels from column `first` to `last` of row y. */
static void read_span(const struct rim *rim, const struct frame_view *frame,
                      const struct rim_view *view, const struct band *band, int64_t y,
                      int64_t first, int64_t last, struct batch *batch)
{
    first = first < 0 ? 0 : first;
    last = last >= frame->width_px ? frame->width_px - 1 : last;
    if (first > last) {
        return;
    }
    luma_span(frame, (uint16_t)y, (uint16_t)first, (unsigned)(last - first + 1), rim->luma_grey_q4);
    const int64_t dy_q16 = (y << 16) - view->ellipse.y_px_q16;
    const int64_t dx_q16 = (first << 16) - view->ellipse.x_px_q16;
    int64_t p_q40 = dx_q16 * view->over_xx_q40;
    int64_t q_q40 =
        (dy_q16 - fx_round_shift_i64(dx_q16 * view->slope_q24, 24)) * view->over_yy_q40;
    const int64_t p_step_q40 = view->over_xx_q40 * 65536;
    const int64_t q_step_q40 = -((view->slope_q24 * view->over_yy_q40) >> 8);
    for (int64_t i = 0; i <= last - first; i++) {
        if (read_pixel(rim, view, band, p_q40 >> 16, q_q40 >> 16, (first + i) << 16, y << 16,
                       rim->luma_grey_q4[i], rim->columns + batch->waiting, batch->sums)) {
            batch->waiting++;
            if (batch->waiting == DSP_BATCH) {
                sum_batch(rim, batch);
            }
        }
        p_q40 += p_step_q40;
        q_q40 += q_step_q40;
    }
}

/* The half width, in pixels, of the ellipse rho^2 = square in a row where dy^2 / S_yy = v: the root of
 * (S_xx - S_xy^2 / S_yy) (rho^2 - v). Negative where the row does not meet it. */
static int64_t half_width_px_q16(int64_t across_px2_q12, int64_t square_q16, int64_t v_q16)
{
    if (square_q16 <= v_q16) {
        return -1;
    }
    const int64_t half_px2_q10 = (across_px2_q12 * (square_q16 - v_q16)) >> 18;
    const uint32_t bounded = half_px2_q10 < UINT32_MAX ? (uint32_t)half_px2_q10 : UINT32_MAX;
    return profile_root_q24(bounded) >> 1; /* root of Q10 times 2^12: Q17 */
}

static void take_products(const struct rim_view *view, const struct batch *batch,
                          struct rim_sums *sums)
{
    unsigned at = 0;
    for (unsigned row = 0; row < RIM_UNKNOWNS; row++) {
        for (unsigned col = 0; col <= row; col++) {
            sums->matrix_q40[row][col] = batch->products[at++] * (1 << 18);
        }
    }
    /* A rest is Q12 of 4096 grey_q4 in the first pass and Q11 of the enlarged scale later; times Q11,
     * and Q48 is wanted. */
    for (unsigned row = 0; row < RIM_UNKNOWNS; row++) {
        sums->right_q48[row] = batch->products[at++] * ((int64_t)1 << (view->fine ? 26 : 25));
    }
    sums->squares_q44 = view->fine ? batch->products[at] * (1 << 22) : 0;
}

/* From a row to the next that is visited. */
static int64_t thin_step(const struct rim_view *view)
{
    if (view->fine || view->size_px_q16 < THIN_MIN_PX_Q16) {
        return 1;
    }
    const int64_t step = view->size_px_q16 / THIN_SHARE_PX_Q16;
    return step < 2 ? 2 : step > THIN_STEP_MAX ? THIN_STEP_MAX : step;
}

void rim_gather(const struct rim *rim, const struct frame_view *frame, const struct rim_view *view,
                struct rim_sums *sums)
{
    const struct ellipse *e = &view->ellipse;
    const struct band band = make_band(view);
    struct batch batch = {.sums = sums};
    *sums = (struct rim_sums){.count = 0};
    if (!band.within_range) {
        return;
    }
    const int64_t step = thin_step(view);
    const int64_t half_y_q16 =
        (int64_t)root_u64(((uint64_t)e->shape_yy_px2_q12 * (uint64_t)band.outer_square_q16) << 4);
    int64_t top = (e->y_px_q16 - half_y_q16) >> 16;
    int64_t bottom = (e->y_px_q16 + half_y_q16 + 65535) >> 16;
    top = top < 0 ? 0 : top;
    bottom = bottom >= frame->height_px ? frame->height_px - 1 : bottom;
    const int64_t lean_q16 = (int64_t)e->shape_xy_px2_q12 * 65536 / e->shape_yy_px2_q12;
    const int64_t across_px2_q12 =
        e->shape_xx_px2_q12 - ((e->shape_xy_px2_q12 * lean_q16) >> 16);
    const int64_t over_yy_q28 = ((int64_t)1 << 40) / e->shape_yy_px2_q12;
    for (int64_t y = top; y <= bottom; y += step) {
        const int64_t dy_q16 = (y << 16) - e->y_px_q16;
        const int64_t v_q16 = (((dy_q16 * dy_q16) >> 16) * over_yy_q28) >> 28;
        const int64_t outer = half_width_px_q16(across_px2_q12, band.outer_square_q16, v_q16);
        const int64_t inner = half_width_px_q16(across_px2_q12, band.inner_square_q16, v_q16);
        if (outer < 0) {
            continue;
        }
        const int64_t middle = e->x_px_q16 + ((dy_q16 * lean_q16) >> 16);
        const int64_t left = (middle - outer - SPAN_MARGIN_PX_Q16 + 65535) >> 16;
        const int64_t right = (middle + outer + SPAN_MARGIN_PX_Q16) >> 16;
        if (inner > SPAN_MARGIN_PX_Q16) {
            const int64_t left_end = (middle - inner + SPAN_MARGIN_PX_Q16) >> 16;
            const int64_t right_begin = (middle + inner - SPAN_MARGIN_PX_Q16 + 65535) >> 16;
            read_span(rim, frame, view, &band, y, left, left_end, &batch);
            read_span(rim, frame, view, &band, y,
                      right_begin > left_end ? right_begin : left_end + 1, right, &batch);
        } else {
            read_span(rim, frame, view, &band, y, left, right, &batch);
        }
    }
    sum_batch(rim, &batch);
    take_products(view, &batch, sums);
}
