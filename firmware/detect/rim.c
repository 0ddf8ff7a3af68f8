/* See rim.h: which pixels lie in the band, in which units rimrow.h wants them, and the sums. */
#include "firmware/detect/rim.h"

#include "common/fx/fx.h"
#include "common/fx/root.h"
#include "firmware/detect/junction.h"
#include "firmware/detect/luma.h"
#include "firmware/detect/profile.h"

/* The second pass keeps pixels within 1.6 blurs of the edge: those beyond hold 2.4 % of what all pixels know of where
 * it is, and feel most what else is near. The first takes all it can to find it. */
#define BAND_FINE_Q14   26214
/* How near, in blurs, to the triangle's edges: as far in every direction, for what the model of a small
 * circle's rim lacks is the same all around, and must not be seen on one side only. */
#define CLEAR_SIGMAS_Q8 563   /* 2.2: an edge farther off adds less than 1.4 % */
#define CLEAR_KNOWN_Q8  307   /* 1.2: where the edges are part of the model */
#define BAND_MIN_PX_Q16 45875 /* 0.7 */
/* Rows and columns are visited so much beyond the band; the band itself is then exact. */
#define SPAN_MARGIN_PX_Q16 8192
/* So many blurs from the band an edge adds less than 6e-4 of the swing at one spot. */
#define FELT_Q16 (13 << 14) /* 3.25 */
/* In radii: the band's pixels are then within the range of rimrow.h. */
#define OUTWARDS_MAX_Q16 111411 /* 1.7 */
/* The first pass, which the second corrects, takes every second row of circles of this size, and of larger ones so
 * many that four or more cross the circle. */
#define THIN_MIN_PX_Q16   245760 /* 3.75 */
#define THIN_SHARE_PX_Q16 (2 << 16)
#define THIN_STEP_MAX     6
/* Blur over radius: the circles that are kept stay below (curve.h). */
#define EPS_MAX_Q16 62259 /* 0.95 */
/* Peaks narrower than this, in radii, have ended at the rim, so that it does not matter that it cuts them. */
#define PEAK_WIDE_Q16 29491 /* 0.45 */

/* A rest in 1/32 grey_q4 is Q11 of an enlargement by so many bits. */
#define REST_BITS 6

static_assert(JUNCTION_RAYS == PATTERN_RAYS, "each ray is felt");
static_assert(RIMROW_COLUMNS == RIM_UNKNOWNS + 1, "a Jacobian's row and the rest");

/* What all pixels of a view share. */
struct band {
    int64_t inside_px_q16;    /* 1.6 s, or 2 s */
    int64_t clear_px_q16;     /* 2.2 s, or 1.2 s */
    int64_t outer_square_q16; /* rho^2 within which the whole band lies */
    int64_t inner_square_q16; /* and without; 0: the centre may be in it */
    int64_t outer_q16;        /* rho at the band's outer end */
    int64_t alpha_q16;        /* minor over major semi-axis */
    bool    within_range;     /* (R / h)^2 is nowhere too small or large to be looked up */
};

static int16_t band_q14(const struct rim_view *view)
{
    return view->fine ? BAND_FINE_Q14 : RIMROW_BAND_MAX_Q14;
}

static struct band make_band(const struct rim_view *view)
{
    struct band band = {
        .inside_px_q16 = ((int64_t)view->blur_px_q16 * band_q14(view)) >> 14,
        .clear_px_q16 = ((int64_t)view->blur_px_q16 *
                         (view->edges.known ? CLEAR_KNOWN_Q8 : CLEAR_SIGMAS_Q8)) >> 8,
    };
    /* R over the semi-axes: (R / h)^2 is i0 +- root(i1^2 + i2^2) at its ends; a percent to the safe side. */
    const int64_t i0 = view->inverse_q24[0];
    const int64_t i1 = view->inverse_q24[1] >> 8;
    const int64_t i2 = view->inverse_q24[2] >> 8;
    const int64_t swing_q24 = (int64_t)root_u64((uint64_t)(i1 * i1 + i2 * i2)) << 8;
    /* Directions are good to 2^-14, a share that the bounds leave room for. */
    band.within_range = i0 - swing_q24 > 1 << 21 && i0 + swing_q24 < ((int64_t)1 << 27) - (1 << 17);
    band.alpha_q16 = (i0 - swing_q24) >> 8; /* the semi-axes over R are inverse to each other */
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
    const int64_t outer_q16 = 65536 + (outwards_q16 < OUTWARDS_MAX_Q16 ? outwards_q16 : OUTWARDS_MAX_Q16);
    const int64_t inner_q16 = inwards_q16 < 65536 ? 65536 - inwards_q16 : 0;
    band.outer_q16 = outer_q16;
    band.outer_square_q16 = (outer_q16 * outer_q16) >> 16;
    band.inner_square_q16 = (inner_q16 * inner_q16) >> 16;
    return band;
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

/* A value cut to +-limit. */
static int32_t cut(int64_t value, int64_t limit)
{
    return (int32_t)(value > limit ? limit : value < -limit ? -limit : value);
}

/* The line through an edge's middle with the given normal, over the unit frame, in blurs of edges. */
static struct felt_line describe_line(const struct rim_view *view, const struct pattern_edge *at,
                                      int64_t nx_q15, int64_t ny_q15)
{
    const struct ellipse *e = &view->ellipse;
    const struct ellipse_root *b = &view->root;
    const int64_t over_blur_q24 = ((int64_t)1 << 40) / view->edge_blur_px_q16;
    const int64_t t0_px_q16 = (nx_q15 * ((int64_t)e->x_px_q16 - at->x_px_q16) +
                               ny_q15 * ((int64_t)e->y_px_q16 - at->y_px_q16)) >> 15;
    const int64_t p_px_q16 = (nx_q15 * b->xx_px_q16 + ny_q15 * b->yx_px_q16) >> 15;
    const int64_t q_px_q16 = (ny_q15 * b->yy_px_q16) >> 15;
    return (struct felt_line){(t0_px_q16 * over_blur_q24) >> 24, (p_px_q16 * over_blur_q24) >> 24,
                              (q_px_q16 * over_blur_q24) >> 24};
}

static struct junction describe_junction(const struct rim_view *view, const struct pattern_edge *at)
{
    struct junction junction = {
        .edge = describe_line(view, at, at->nx_q15, at->ny_q15),
        .first = at->other ? 1 : 0,
        .ray_count = at->ray_count,
    };
    for (unsigned i = 0; i < at->ray_count; i++) {
        const struct pattern_ray *ray = &at->rays[i];
        junction.rays[i] = (struct junction_ray){
            .line = describe_line(view, at, ray->nx_q15, ray->ny_q15),
            .lean_q15 = (ray->nx_q15 * at->nx_q15 + ray->ny_q15 * at->ny_q15) >> 15,
            .step = ray->step,
        };
    }
    return junction;
}

/* Whether an edge shows in the band. */
static bool is_felt(const struct felt_line *edge, const struct band *band)
{
    const int64_t steep_q16 = (int64_t)root_u64(
        (uint64_t)(edge->tp_q16 * edge->tp_q16 + edge->tq_q16 * edge->tq_q16));
    return edge->t0_q16 - ((steep_q16 * band->outer_q16) >> 16) < FELT_Q16;
}

/* The neighbouring edges that show in the band. */
struct felt_edges {
    struct junction at[RIMROW_EDGES];
    unsigned        count;
    bool            meet; /* at one of them triangles of both colours do */
};

static void feel_edges(const struct rim_view *view, const struct band *band, struct felt_edges *felt)
{
    felt->count = 0;
    felt->meet = false;
    for (unsigned i = 0; view->edges.known && i < view->edges.count; i++) {
        const struct junction edge = describe_junction(view, &view->edges.at[i]);
        if (is_felt(&edge.edge, band)) {
            felt->at[felt->count++] = edge;
            felt->meet |= edge.ray_count > 0;
        }
    }
}

/* Edges for the row kernel, which has plain ones of its own; the others are given to it pixel by pixel. */
static void describe_edges(const struct felt_edges *felt, struct rimrow_view *row)
{
    if (felt->meet) {
        row->edge_count = RIMROW_GIVEN;
        return;
    }
    int64_t largest_q16 = 0;
    for (unsigned i = 0; i < felt->count; i++) {
        const struct felt_line *edge = &felt->at[i].edge;
        const int64_t both_q16 = fx_abs_i64(edge->tp_q16) + fx_abs_i64(edge->tq_q16);
        largest_q16 = both_q16 > largest_q16 ? both_q16 : largest_q16;
    }
    const unsigned bits = fx_bits_i64(largest_q16);
    const unsigned drop = bits > 19 ? bits - 14 : 5;
    for (unsigned i = 0; i < felt->count; i++) {
        const struct felt_line *edge = &felt->at[i].edge;
        row->edges[i] = (struct rimrow_edge){cut(edge->t0_q16 >> 5, 1 << 22),
                                             (int32_t)(edge->tp_q16 >> drop),
                                             (int32_t)(edge->tq_q16 >> drop)};
    }
    row->edge_count = felt->count;
    row->edge_shift = 19 - drop;
}

/* Brightness in the units of rimrow.h. One of 4096 grey_q4 is 2^30 here and 2^17 or 2^14 there. */
static void describe_brightness(const struct rim_view *view, struct rimrow_view *row)
{
    const struct ellipse_root *b = &view->root;
    const int64_t *level = view->level_slope_q30;
    const int64_t *contrast = view->contrast_slope_q30;
    row->level_q5 = cut(view->level_q30 >> 13, 1 << 19);
    row->level_p_q5 = cut((level[0] * b->xx_px_q16 + level[1] * b->yx_px_q16) >> 29, 1 << 14);
    row->level_q_q5 = cut((level[1] * b->yy_px_q16) >> 29, 1 << 14);
    row->contrast_q2 = cut(view->contrast_q30 >> 16, 1 << 14);
    row->contrast_p_q2 =
        cut((contrast[0] * b->xx_px_q16 + contrast[1] * b->yx_px_q16) >> 32, 1 << 12);
    row->contrast_q_q2 = cut((contrast[1] * b->yy_px_q16) >> 32, 1 << 12);
}

/* The printed Gaussian, sg wide, through the blur: with eps = s / R and T = S sg^2 + s^2 the sum of both
 * covariances, sg^2 / root(det) exp(-x' T^-1 x / 2), det = sg^4 + 2 sg^2 eps^2 i0 + eps^4; x' T^-1 x = rho^2
 * (sg^2 + eps^2 (i0 - y)) / det. */
static void describe_profile(const struct rim *rim, const struct rim_view *view,
                             const struct band *band, struct rimrow_view *row)
{
    const int64_t eps_q16 = ((int64_t)view->blur_px_q16 << 16) / view->size_px_q16;
    const int64_t cut_q16 = eps_q16 < EPS_MAX_Q16 ? eps_q16 : EPS_MAX_Q16;
    int32_t curve_q14[CURVE_TERMS];
    curve_at(cut_q16, band->alpha_q16, curve_q14);
    rimrow_set_bend(row, curve_q14, cut_q16);

    const int64_t blur_q28 = (cut_q16 * cut_q16) >> 4;
    const int64_t peak_q28 = (rim->gauss_sigma_q16 * rim->gauss_sigma_q16) >> 4;
    const int64_t mean_q28 = (blur_q28 * view->inverse_q24[0]) >> 24;
    /* Peaks of up to 8 radii: sg^4 is 2^12, 2^40 here. Narrow ones need every bit of theirs. */
    const unsigned drop = rim->gauss_sigma_q16 > 2 << 16 ? 8 : 0;
    const int64_t peak = peak_q28 >> drop;
    const int64_t det_q28 = ((peak * peak) >> (28 - 2 * drop)) + ((peak * mean_q28) >> (27 - drop)) +
                            ((blur_q28 * blur_q28) >> 28);
    const int64_t whole_q28 = det_q28 > 0 ? det_q28 : 1;
    rimrow_set_fall(row, ((peak_q28 + mean_q28) << 14) / whole_q28, (blur_q28 << 14) / whole_q28);
    const int64_t width_q28 = (int64_t)root_u64((uint64_t)whole_q28 << (28 - drop)) << (drop / 2);
    const int64_t share_q14 = (peak_q28 << 14) / (width_q28 > 0 ? width_q28 : 1);
    const int64_t swing_q15 = ((32768 - rim->edge_q15) * rim->over_rim_q15) >> 15;
    /* 2.5066 = 1 / phi(0). */
    row->peak = rimrow_gain_of((((swing_q15 * share_q14) >> 14) * FX_Q(2.506628, 14)) >> 6);
    row->peak_shown_q15 = rim->gauss_sigma_q16 > PEAK_WIDE_Q16 ? 0 : INT16_MAX;
    row->edge_q14 = (int16_t)cut((rim->edge_q15 * rim->over_rim_q15) >> 16, (2 << 14) - 1);
}

static void describe_view(const struct rim *rim, const struct rim_view *view,
                          const struct band *band, const struct felt_edges *felt,
                          struct rimrow_view *row)
{
    const int64_t over_blur_q16 = ((int64_t)view->size_px_q16 << 16) / view->blur_px_q16; /* R / s */
    *row = (struct rimrow_view){
        .gap_q11 = (int16_t)cut((view->gap_q16 * over_blur_q16) >> 21, (16 << 11) - 1),
        .band_q14 = band_q14(view),
        .clear_q11 = (view->edges.known ? CLEAR_KNOWN_Q8 : CLEAR_SIGMAS_Q8) * 8,
        .near_q11 = (int16_t)cut(((int64_t)BAND_MIN_PX_Q16 << 11) / view->blur_px_q16, 15 << 11),
        .over_rim = rimrow_gain_of(cut(rim->over_rim_q15, 16 << 15) * (int64_t)(1 << 9)),
        .rest_shift = 5,
    };
    const int64_t most_q24 = 2 * view->inverse_q24[0] - ((int64_t)band->alpha_q16 << 8);
    rimrow_set_shape(row, view->inverse_q24, most_q24, over_blur_q16);
    describe_profile(rim, view, band, row);
    describe_edges(felt, row);
    if (view->fine) {
        describe_brightness(view, row);
        row->rest_shift = REST_BITS - RIM_FINE_BITS;
    }
}

static void describe_steps(const struct rim_view *view, struct rimrow_steps *steps)
{
    const int64_t q_step_q24 = -((view->slope_q24 * view->over_yy_q40) >> 24);
    for (int64_t i = 0; i <= RIMROW_RAMP; i++) {
        steps->p_q24[i] = (int32_t)(i * view->over_xx_q40);
        steps->q_q24[i] = (int32_t)(i * q_step_q24);
    }
}

/* Pixels read and not summed yet, and the sums so far. */
struct batch {
    struct rimrow_view view;
    struct felt_edges  felt;
    int64_t            products[DSP_PRODUCTS];
    int64_t            octant_squares[8];
    uint32_t           octant_count[8];
    uint32_t           waiting;
    bool               fine;
    struct rimrow_steps steps;
};

/* What edges with more than one colour behind them bring to each pixel. */
static void give_edges(const struct felt_edges *felt, uint32_t count, struct rimrow_batch *pixels)
{
    for (uint32_t i = 0; i < count; i++) {
        int32_t others_q15 = 0;
        int32_t growth_q15 = 0;
        bool inside = true;
        for (unsigned k = 0; k < felt->count; k++) {
            inside &= junction_add(&felt->at[k], pixels->p_q14[i], pixels->q_q14[i], &others_q15,
                                   &growth_q15);
        }
        pixels->others_q14[i] = (int16_t)(inside ? others_q15 / 2 : RIMROW_BEYOND_Q14);
        pixels->growth_q14[i] = (int16_t)(growth_q15 / 2);
    }
}

static void sum_batch(const struct rim *rim, struct batch *batch)
{
    struct rimrow_batch *pixels = rim->pixels;
    const uint32_t whole = (batch->waiting + RIMROW_STEP - 1) / RIMROW_STEP * RIMROW_STEP;
    for (uint32_t i = batch->waiting; i < whole; i++) {
        pixels->p_q14[i] = 0; /* the centre is never in the band */
        pixels->q_q14[i] = 0;
    }
    if (batch->felt.meet) {
        give_edges(&batch->felt, whole, pixels);
    }
    rim->dsp->rim_rows(&batch->view, whole, pixels);
    rim->dsp->products(pixels->columns, whole, batch->products);
    if (batch->fine) {
        uint32_t squares[8];
        uint32_t counts[8];
        rim->dsp->rim_octants(pixels, whole, squares, counts);
        for (unsigned i = 0; i < 8; i++) {
            batch->octant_squares[i] += squares[i];
            batch->octant_count[i] += counts[i];
        }
    }
    batch->waiting = 0;
}

/* Bytes of luma from the pixel on, where rows are such and a whole step more lies in the row; else NULL. */
static const uint8_t *bytes_at(const struct frame_view *frame, uint32_t y, uint32_t x, uint32_t count)
{
    const bool plain = frame->format == FRAME_GREY8 || frame->format == FRAME_NV12;
    return plain && x + count + RIMROW_RAMP <= frame->width_px
               ? frame->pixels + (size_t)y * frame->stride_bytes + x
               : NULL;
}

/* Row y of the frame, as spans of it are read. */
struct row {
    uint32_t y;
    int32_t  x_px;  /* near the centre, where p and q are: */
    int32_t  p_q24;
    int32_t  q_q24;
};

/* Reads the pixels from column `first` to `last` of a row. Spans are short: that it is inline counts. */
static inline __attribute__((always_inline)) void
read_span(const struct rim *rim, const struct frame_view *frame, const struct row *row, int64_t first,
          int64_t last, struct batch *batch)
{
    struct rimrow_batch *pixels = rim->pixels;
    int32_t x = first < 0 ? 0 : (int32_t)first;
    const int32_t end = last >= frame->width_px ? frame->width_px : (int32_t)last + 1;
    while (x < end) {
        const uint32_t at = batch->waiting;
        const uint32_t wanted = (uint32_t)(end - x);
        const uint32_t count = wanted < RIMROW_PIXELS - at ? wanted : RIMROW_PIXELS - at;
        const uint8_t *bytes = bytes_at(frame, row->y, (uint32_t)x, count);
        rim->dsp->rim_span(&batch->steps, row->p_q24 + (x - row->x_px) * batch->steps.p_q24[1],
                           row->q_q24 + (x - row->x_px) * batch->steps.q_q24[1], bytes, count,
                           pixels->p_q14 + at, pixels->q_q14 + at, pixels->grey_q4 + at);
        if (bytes == NULL) {
            luma_span(frame, (uint16_t)row->y, (uint16_t)x, count, pixels->grey_q4 + at);
        }
        x += (int32_t)count;
        batch->waiting = at + count;
        if (batch->waiting == RIMROW_PIXELS) {
            sum_batch(rim, batch);
        }
    }
}

static void take_sums(const struct batch *batch, struct rim_sums *sums)
{
    unsigned at = 0;
    for (unsigned row = 0; row < RIM_UNKNOWNS; row++) {
        for (unsigned col = 0; col <= row; col++) {
            sums->matrix_q40[row][col] = batch->products[at++] * (1 << 18);
        }
    }
    /* The level's entry is 1, Q11, for every pixel. */
    sums->count = (uint32_t)(sums->matrix_q40[RIM_LEVEL][RIM_LEVEL] >> 40);
    /* A rest is Q12 of 4096 grey_q4 in the first pass and Q11 of the enlarged scale later; times Q11, and Q40 is
     * wanted. Rims have up to 2^16 pixels, so that products are below 2^40. */
    for (unsigned row = 0; row < RIM_UNKNOWNS; row++) {
        sums->right_q40[row] = batch->products[at++] * ((int64_t)1 << (batch->fine ? 18 : 17));
    }
    if (batch->fine) {
        sums->squares_q44 = batch->products[at] * (1 << 22);
        for (unsigned i = 0; i < 8; i++) {
            sums->octant_squares_q44[i] = batch->octant_squares[i] * (1 << 22);
            sums->octant_count[i] = batch->octant_count[i];
        }
    }
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

/* Which columns of a row lie in the band: an ellipse without the one inside of it. */
struct columns {
    int64_t across_px2_q12; /* S_xx - S_xy^2 / S_yy */
    int64_t lean_q16;       /* S_xy / S_yy */
    int64_t over_yy_q28;    /* 1 / S_yy */
};

static void read_row(const struct rim *rim, const struct frame_view *frame, const struct band *band,
                     const struct columns *columns, const struct ellipse *e, const struct row *row,
                     struct batch *batch)
{
    const int64_t dy_q16 = ((int64_t)row->y << 16) - e->y_px_q16;
    const int64_t v_q16 = (((dy_q16 * dy_q16) >> 16) * columns->over_yy_q28) >> 28;
    const int64_t outer = half_width_px_q16(columns->across_px2_q12, band->outer_square_q16, v_q16);
    const int64_t inner = half_width_px_q16(columns->across_px2_q12, band->inner_square_q16, v_q16);
    if (outer < 0) {
        return;
    }
    const int64_t middle = e->x_px_q16 + ((dy_q16 * columns->lean_q16) >> 16);
    const int64_t left = (middle - outer - SPAN_MARGIN_PX_Q16 + 65535) >> 16;
    const int64_t right = (middle + outer + SPAN_MARGIN_PX_Q16) >> 16;
    int64_t right_begin = left;
    if (inner > SPAN_MARGIN_PX_Q16) {
        const int64_t left_end = (middle - inner + SPAN_MARGIN_PX_Q16) >> 16;
        right_begin = (middle + inner - SPAN_MARGIN_PX_Q16 + 65535) >> 16;
        right_begin = right_begin > left_end ? right_begin : left_end + 1;
        read_span(rim, frame, row, left, left_end, batch);
    }
    read_span(rim, frame, row, right_begin, right, batch);
}

void rim_gather(const struct rim *rim, const struct frame_view *frame, const struct rim_view *view,
                struct rim_sums *sums)
{
    const struct ellipse *e = &view->ellipse;
    const struct band band = make_band(view);
    struct batch batch = {.fine = view->fine};
    *sums = (struct rim_sums){.count = 0};
    if (!band.within_range) {
        return;
    }
    feel_edges(view, &band, &batch.felt);
    describe_view(rim, view, &band, &batch.felt, &batch.view);
    describe_steps(view, &batch.steps);
    const int64_t lean_q16 = (int64_t)e->shape_xy_px2_q12 * 65536 / e->shape_yy_px2_q12;
    const struct columns columns = {
        .across_px2_q12 = e->shape_xx_px2_q12 - ((e->shape_xy_px2_q12 * lean_q16) >> 16),
        .lean_q16 = lean_q16,
        .over_yy_q28 = ((int64_t)1 << 40) / e->shape_yy_px2_q12,
    };
    const int64_t half_y_q16 =
        (int64_t)root_u64(((uint64_t)e->shape_yy_px2_q12 * (uint64_t)band.outer_square_q16) << 4);
    int64_t top = (e->y_px_q16 - half_y_q16) >> 16;
    int64_t bottom = (e->y_px_q16 + half_y_q16 + 65535) >> 16;
    top = top < 0 ? 0 : top;
    bottom = bottom >= frame->height_px ? frame->height_px - 1 : bottom;

    struct row row = {.x_px = e->x_px_q16 >> 16};
    const int64_t dx_q16 = (int64_t)row.x_px * 65536 - e->x_px_q16; /* p = dx / B_xx */
    row.p_q24 = (int32_t)((dx_q16 * view->over_xx_q40) >> 16);
    const int64_t sheared_q16 = e->y_px_q16 + fx_round_shift_i64(dx_q16 * view->slope_q24, 24);
    const int64_t step = thin_step(view);
    for (int64_t y = top; y <= bottom; y += step) {
        row.y = (uint32_t)y;
        row.q_q24 = (int32_t)((((y << 16) - sheared_q16) * view->over_yy_q40) >> 16);
        read_row(rim, frame, &band, &columns, e, &row, &batch);
    }
    sum_batch(rim, &batch);
    take_sums(&batch, sums);
}
