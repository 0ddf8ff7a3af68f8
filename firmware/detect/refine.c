/* See refine.h. Unit-frame coordinates are Q24; Jacobian entries Q20; brightness is in units of 4096
 * grey_q4, Q30, the second pass 64 times finer. */
#include "firmware/detect/refine.h"

#include "common/fx/fx.h"
#include "common/fx/root.h"
#include "common/fx/smallsolve.h"
#include "firmware/detect/luma.h"
#include "firmware/detect/profile.h"

#define BLUR_MIN_PX_Q16   26214 /* 0.4 */
#define BLUR_MAX_PX_Q16   262144 /* 4 */
#define PIVOT_FLOOR_Q30   ((int64_t)1 << 12)
#define CONTRAST_MIN_Q30  ((int64_t)1 << 23) /* 2 grey levels of 256 */
/* Noise over contrast that counts: so many times the frame's median, and a little for small circles
 * whose neighbours' edges reach into their band. */
#define NOISE_BINS        256u
#define NOISE_BIN_Q16     64u /* 0.001 */
#define NOISE_SHARE       2u
#define NOISE_SLACK_Q16   800u  /* 0.012 */
#define WORST_SHARE       3u
#define WORST_SLACK_Q16   1400u /* 0.021 */
#define OCTANT_PIXELS_MIN 4u
/* Planes through black and white: six circles at least, over some ten pixels; slopes up to a 64th of the
 * range a pixel. Offsets are in units of 2^10 px, Q30. */
#define LIGHT_CIRCLES_MIN 6u
#define LIGHT_NEAR_MAX    256u
#define LIGHT_REACH_SIZES 14u /* around the anchor: one patch and a half */
#define LIGHT_SCALE       16
#define LIGHT_PIVOT_Q30   ((int64_t)1 << 15)
#define LIGHT_LIMIT_Q30   ((int64_t)1 << 24)
/* A circle nearer than this to its triangle's edges, in blurs, is drawn towards them by more than it can
 * say: 0.3 px at 1.4. */
#define GAP_SIGMAS_Q8     384 /* 1.5 */

/* exp(-t^2 / 2) by the normal density; 0 beyond t = 4. */
static int64_t exp_q15(int64_t t_q16)
{
    if (t_q16 >= (int64_t)4 << 16) {
        return 0;
    }
    int32_t bell_q15;
    (void)profile_edge((int32_t)t_q16, &bell_q15);
    return (bell_q15 * FX_Q(2.5066283, 13)) >> 13;
}

void refine_init(struct refine *refine, struct arena *arena, const struct dsp_kernels *dsp,
                 const struct patches_settings *settings, uint32_t kernel_sigma_px_q16,
                 unsigned width)
{
    refine->rim.dsp = dsp;
    refine->rim.luma_grey_q4 = arena_take(arena, width, sizeof(uint16_t));
    refine->rim.columns = arena_take(arena, DSP_COLUMNS * DSP_BATCH, sizeof(int16_t));
    refine->views = arena_take(arena, LAYOUT_FEATURES_MAX, sizeof(struct rim_view));
    refine->near = arena_take(arena, LIGHT_NEAR_MAX, sizeof(uint32_t));
    refine->pairs = arena_take(arena, LAYOUT_FEATURES_LEVEL2, sizeof(struct boardmap_pair));
    refine->circle_ratio_q16 = settings->circle_ratio_q16;
    refine->kernel_sigma_px_q16 = kernel_sigma_px_q16;

    /* level(rho) = e + (1 - e) exp(-rho^2 / 2 sigma^2), over level(1). */
    const int64_t edge_q15 = settings->edge_level_q16 / 2;
    const uint32_t sigma_q16 = settings->gauss_sigma_q16 > 1024 ? settings->gauss_sigma_q16 : 1024;
    const int64_t over_q16 = ((int64_t)1 << 32) / sigma_q16;
    int64_t rim_q15 = edge_q15 + (((32768 - edge_q15) * exp_q15(over_q16)) >> 15);
    rim_q15 = rim_q15 > 0 ? rim_q15 : 1; /* a target may state circles that have no edge at all */
    refine->rim.over_rim_q15 = ((int64_t)1 << 30) / rim_q15;
    for (uint32_t i = 0; i <= RIM_PEAK_STEPS; i++) {
        const int64_t rho_q16 = profile_root_q24((i << 24) / RIM_PEAK_STEPS) >> 8;
        const int64_t level_q15 =
            edge_q15 + (((32768 - edge_q15) * exp_q15((rho_q16 * over_q16) >> 16)) >> 15);
        refine->rim.peak_q15[i] = (uint32_t)((level_q15 << 15) / rim_q15);
    }
}

/* Fills what follows from the ellipse. |grad rho|^2 = p' (B'B)^-1 p on the unit circle: with B^-1 =
 * (1/x, 0; -y/(x z), 1/z) its matrix is B^-1 B'^-1 = (k0, k1; k1, k2), and p' K p = (k0 + k2)/2 +
 * (k0 - k2)/2 (pp - qq) + k1 2 p q. */
static bool prepare_view(struct rim_view *view)
{
    if (!ellipse_take_root(&view->ellipse, &view->root)) {
        return false;
    }
    const struct ellipse_root *b = &view->root;
    view->size_px_q16 = ellipse_size_px_q16(&view->ellipse);
    if (fx_abs_i64(b->yx_px_q16) > 16 * (int64_t)b->xx_px_q16 || view->size_px_q16 < 65536) {
        return false;
    }
    view->over_xx_q40 = ((int64_t)1 << 40) / b->xx_px_q16;
    view->over_yy_q40 = ((int64_t)1 << 40) / b->yy_px_q16;
    view->slope_q24 = b->yx_px_q16 * ((int64_t)1 << 24) / b->xx_px_q16;
    /* Entries of R B^-1, Q24; at most 5 for the ellipses that pass the fits. */
    const int64_t size = view->size_px_q16;
    const int64_t ix = (size << 24) / b->xx_px_q16;
    const int64_t iz = (size << 24) / b->yy_px_q16;
    const int64_t iy = -fx_round_shift_i64(view->slope_q24 * iz, 24);
    if (ix > (int64_t)8 << 24 || iz > (int64_t)8 << 24 || fx_abs_i64(iy) > (int64_t)8 << 24) {
        return false;
    }
    const int64_t k0 = fx_round_shift_i64(ix * ix, 24);
    const int64_t k1 = fx_round_shift_i64(ix * iy, 24);
    const int64_t k2 = fx_round_shift_i64(iy * iy + iz * iz, 24);
    view->inverse_q24[0] = (k0 + k2) / 2;
    view->inverse_q24[1] = (k0 - k2) / 2;
    view->inverse_q24[2] = k1;
    return true;
}

/* One least-squares solution; factored stays for the covariance. */
static bool solve_pixels(const struct rim_sums *sum, struct smallsolve *factored,
                         int64_t solution_q30[RIM_UNKNOWNS])
{
    if (sum->count < 3 * RIM_UNKNOWNS) {
        return false;
    }
    factored->size = RIM_UNKNOWNS;
    for (unsigned row = 0; row < RIM_UNKNOWNS; row++) {
        for (unsigned col = 0; col <= row; col++) {
            factored->at_q30[row][col] =
                fx_round_shift_i64(sum->matrix_q40[row][col] / sum->count, 10);
        }
        /* Q20 times Q28. */
        solution_q30[row] = fx_round_shift_i64(sum->right_q48[row] / sum->count, 18);
        if (fx_abs_i64(solution_q30[row]) > (int64_t)4 << 30) {
            return false;
        }
    }
    return smallsolve_factor(factored, PIVOT_FLOOR_Q30) && smallsolve_solve(factored, solution_q30);
}

/* part / whole, |part| <= |whole|. The second pass's numbers are 64 times finer, up to 2^37: low bits are
 * dropped so that the product stays below 2^63. */
static int64_t part_over_whole_q30(int64_t part, int64_t whole)
{
    const unsigned bits = fx_bits_i64(whole);
    const unsigned drop = bits > 32 ? bits - 32 : 0;
    return (part >> drop) * ((int64_t)1 << 30) / (whole >> drop);
}

/* Applies a solution whose geometric part is c theta R / s, given c on the same scale. */
static bool apply_solution(struct rim_view *view, const int64_t solution_q30[RIM_UNKNOWNS],
                           int64_t contrast_q30)
{
    /* theta = part / c * s / R. */
    const int64_t share_q24 = ((int64_t)view->blur_px_q16 << 24) / view->size_px_q16;
    int64_t step_q36[ELLIPSE_UNKNOWNS];
    for (unsigned i = 0; i < ELLIPSE_UNKNOWNS; i++) {
        const int64_t part = solution_q30[i];
        if (fx_abs_i64(part) > fx_abs_i64(contrast_q30)) {
            return false; /* a move by more than the blur */
        }
        const int64_t over_q30 = part_over_whole_q30(part, contrast_q30);
        step_q36[i] = fx_round_shift_i64(over_q30 * share_q24, 18);
    }
    const int64_t blur_q30 = solution_q30[RIM_BLUR];
    if (2 * fx_abs_i64(blur_q30) > fx_abs_i64(contrast_q30)) {
        return false;
    }
    const int64_t blur_change_q30 = part_over_whole_q30(blur_q30, contrast_q30);
    view->blur_px_q16 += (int32_t)fx_round_shift_i64(view->blur_px_q16 * blur_change_q30, 30);
    return view->blur_px_q16 >= BLUR_MIN_PX_Q16 && view->blur_px_q16 <= BLUR_MAX_PX_Q16 &&
           ellipse_step(&view->ellipse, &view->root, step_q36) && prepare_view(view);
}

/* sigma^2 = m^2 / c^2 s^2 / R^2 trace(B N^-1 B') / (2 n), m^2 the pixels' variance. noise_q52 is m^2
 * on the fine scale. */
static bool find_sigma(const struct rim_view *view, const struct rim_sums *sum,
                       const struct smallsolve *factored, int64_t noise_q52, struct mark *mark)
{
    int64_t for_x_q30[RIM_UNKNOWNS] = {(int64_t)1 << 30};
    int64_t for_y_q30[RIM_UNKNOWNS] = {0, (int64_t)1 << 30};
    if (!smallsolve_solve(factored, for_x_q30) || !smallsolve_solve(factored, for_y_q30)) {
        return false;
    }
    const int64_t bx = ((int64_t)view->root.xx_px_q16 << 16) / view->size_px_q16;
    const int64_t by = (int64_t)view->root.yx_px_q16 * 65536 / view->size_px_q16;
    const int64_t bz = ((int64_t)view->root.yy_px_q16 << 16) / view->size_px_q16;
    const int64_t trace_q16 = fx_round_shift_i64(
        ((bx * bx + by * by) >> 16) * (for_x_q30[0] >> 14) +
            2 * ((by * bz) >> 16) * (for_x_q30[1] >> 14) + ((bz * bz) >> 16) * (for_y_q30[1] >> 14),
        16);
    if (trace_q16 <= 0 || trace_q16 > INT32_MAX) {
        return false;
    }
    /* m / c in Q30: the root is 64 m in Q26. m is below 1/32, so it is below 2^28. */
    const uint64_t contrast_q30 = (uint64_t)fx_abs_i64(view->contrast_q30);
    const uint64_t ratio_q30 = ((uint64_t)root_u64((uint64_t)noise_q52) << 28) / contrast_q30;
    const uint64_t spread_q24 = root_u64(((uint64_t)trace_q16 << 32) / (2u * sum->count));
    const uint64_t sigma_q20 =
        (((ratio_q30 * spread_q24) >> 20) * (uint64_t)view->blur_px_q16) >> 30;
    mark->sigma_px_q20 = (uint32_t)(sigma_q20 > UINT32_MAX ? UINT32_MAX : sigma_q20);
    mark->noise_q16 = fx_saturate_u16((int64_t)(ratio_q30 >> 14));
    return true;
}

/* What the solution leaves of the squares, per degree of freedom, on the fine scale; Q52. */
static int64_t left_over_q52(const struct rim_sums *sum, const int64_t solution_q30[RIM_UNKNOWNS])
{
    int64_t left_q52 = sum->squares_q44 / sum->count * 256;
    for (unsigned i = 0; i < RIM_UNKNOWNS; i++) {
        const int64_t right_q30 = fx_round_shift_i64(sum->right_q48[i] / sum->count, 18);
        left_q52 -= (solution_q30[i] >> 4) * (right_q30 >> 4);
    }
    return left_q52 > 0 ? left_q52 / (sum->count - RIM_UNKNOWNS) * sum->count : 0;
}

/* The noisiest eighth of the rim, over the contrast: what covers a part of a circle disturbs one side. */
static uint16_t worst_octant_q16(const struct rim_view *view, const struct rim_sums *sum)
{
    int64_t worst_q44 = 0;
    for (unsigned i = 0; i < 8; i++) {
        if (sum->octant_count[i] >= OCTANT_PIXELS_MIN) {
            const int64_t mean_q44 = sum->octant_squares_q44[i] / sum->octant_count[i];
            worst_q44 = mean_q44 > worst_q44 ? mean_q44 : worst_q44;
        }
    }
    /* The root is 64 m in Q22; over c in Q30. */
    const uint64_t root_q22 = root_u64((uint64_t)worst_q44);
    return fx_saturate_u16((int64_t)((root_q22 << 18) / (uint64_t)fx_abs_i64(view->contrast_q30)));
}

/* The brightness at unit-frame place (p, q), nearest pixel; false outside the frame. */
static bool sample(const struct frame_view *frame, const struct rim_view *view, int32_t p_q16,
                   int32_t q_q16, uint16_t *grey_q4)
{
    const int64_t x_q16 = view->ellipse.x_px_q16 +
                          fx_round_shift_i64((int64_t)view->root.xx_px_q16 * p_q16, 16);
    const int64_t y_q16 = view->ellipse.y_px_q16 +
                          fx_round_shift_i64((int64_t)view->root.yx_px_q16 * p_q16 +
                                                 (int64_t)view->root.yy_px_q16 * q_q16, 16);
    const int64_t x = (x_q16 + 32768) >> 16;
    const int64_t y = (y_q16 + 32768) >> 16;
    if (x < 0 || y < 0 || x >= frame->width_px || y >= frame->height_px) {
        return false;
    }
    luma_span(frame, (uint16_t)y, (uint16_t)x, 1, grey_q4);
    return true;
}

/* A first blur: a step of contrast c has, filtered, the slope c / (sqrt(2 pi) s_total), with s_total^2 =
 * s^2 + kernel^2. The contrast is four fifths of the centre's over the triangle's half way out. */
static bool estimate_blur(const struct refine *refine, const struct frame_view *frame,
                          const struct mark *mark, struct rim_view *view)
{
    static const int8_t directions[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    const int32_t out_q16 = (int32_t)(65536 + view->gap_q16 / 2);
    uint16_t centre_q4;
    if (mark->gradient_q3 == 0 || out_q16 > 4 << 16 || !sample(frame, view, 0, 0, &centre_q4)) {
        return false;
    }
    int64_t outside = 0;
    int64_t count = 0;
    for (unsigned i = 0; i < 4; i++) {
        uint16_t grey_q4;
        if (sample(frame, view, directions[i][0] * out_q16, directions[i][1] * out_q16,
                   &grey_q4)) {
            outside += grey_q4;
            count++;
        }
    }
    if (count == 0) {
        return false;
    }
    const int64_t contrast_q4 = fx_abs_i64(centre_q4 - outside / count) * 13 / 16;
    const int64_t total_q16 = contrast_q4 * FX_Q(8.0 * 0.3989423, 16) / mark->gradient_q3;
    const int64_t kernel_q16 = refine->kernel_sigma_px_q16;
    const int64_t square_q32 = total_q16 * total_q16 - kernel_q16 * kernel_q16;
    int64_t blur_q16 = square_q32 > 0 ? root_u64((uint64_t)square_q32) : 0;
    blur_q16 = blur_q16 < 45875 ? 45875 : blur_q16;
    view->blur_px_q16 = (int32_t)(blur_q16 > 163840 ? 163840 : blur_q16);
    return true;
}

/* The first solution, from raw pixels and the blur in *view. False where there is no such circle. */
static bool fit_coarse(const struct refine *refine, const struct frame_view *frame,
                       struct rim_view *view, bool white)
{
    struct rim_sums sum;
    struct smallsolve factored = {.size = RIM_UNKNOWNS};
    int64_t solution_q30[RIM_UNKNOWNS];
    rim_gather(&refine->rim, frame, view, &sum);
    if (!solve_pixels(&sum, &factored, solution_q30)) {
        return false;
    }
    view->level_q30 = solution_q30[RIM_LEVEL];
    view->contrast_q30 = solution_q30[RIM_CONTRAST];
    view->fine = true;
    /* Bright inside is positive contrast; anything else is another edge. */
    return fx_abs_i64(view->contrast_q30) >= CONTRAST_MIN_Q30 &&
           (view->contrast_q30 > 0) == white &&
           apply_solution(view, solution_q30, view->contrast_q30);
}

/* The second, from what the first left over; with the noise. False leaves the mark as it was. */
static bool fit_fine(const struct refine *refine, const struct frame_view *frame,
                     struct rim_view *view, struct mark *mark)
{
    struct mark fitted = *mark;
    struct rim_sums sum;
    struct smallsolve factored = {.size = RIM_UNKNOWNS};
    int64_t solution_q30[RIM_UNKNOWNS];
    rim_gather(&refine->rim, frame, view, &sum);
    if (!solve_pixels(&sum, &factored, solution_q30) ||
        !find_sigma(view, &sum, &factored, left_over_q52(&sum, solution_q30), &fitted)) {
        return false;
    }
    fitted.worst_q16 = worst_octant_q16(view, &sum);
    if (!apply_solution(view, solution_q30, view->contrast_q30 * (1 << RIM_FINE_BITS))) {
        return false;
    }
    uint32_t major_px_q16;
    uint32_t minor_px_q16;
    uint16_t angle;
    ellipse_axes(&view->ellipse, &major_px_q16, &minor_px_q16, &angle);
    if (fx_round_shift_i64((int64_t)minor_px_q16 * view->gap_q16, 16) <
        ((int64_t)view->blur_px_q16 * GAP_SIGMAS_Q8) >> 8) {
        return false;
    }
    fitted.ellipse = view->ellipse;
    fitted.size_px_q16 = view->size_px_q16;
    *mark = fitted;
    return true;
}

static bool start_view(const struct refine *refine, const struct mark *mark, struct rim_view *view)
{
    *view = (struct rim_view){
        .ellipse = mark->ellipse,
        .gap_q16 = ((int64_t)1 << 32) / refine->circle_ratio_q16 - 65536,
    };
    return prepare_view(view);
}

/* Whether the pixels are as quiet as the frame's others, all around. */
static bool is_clean(const struct refine *refine, const struct mark *mark)
{
    return mark->noise_q16 <= refine->noise_max_q16 && mark->worst_q16 <= refine->worst_max_q16;
}

/* A black circle goes from white (b) to rim_level of the way to black; a white one the other way. */
static void tilt_light(const struct refine *refine, const struct patch_light *light, bool white,
                       struct rim_view *view)
{
    for (unsigned axis = 0; axis < 2; axis++) {
        const int64_t outside = white ? light->black_slope_q30[axis] : light->white_slope_q30[axis];
        const int64_t inside = white ? light->white_slope_q30[axis] : light->black_slope_q30[axis];
        view->level_slope_q30[axis] = outside;
        view->contrast_slope_q30[axis] = (inside - outside) * 32768 / refine->rim.over_rim_q15;
    }
}

bool refine_predicted(const struct refine *refine, const struct frame_view *frame,
                      const struct pattern_edges *edges, const struct patch_light *light,
                      struct mark *mark)
{
    struct rim_view view;
    if (refine->blur_px_q16 == 0 || !start_view(refine, mark, &view)) {
        return false;
    }
    view.edges = *edges;
    tilt_light(refine, light, mark->white, &view);
    view.blur_px_q16 = refine->blur_px_q16;
    view.edge_blur_px_q16 = refine->edge_blur_px_q16;
    struct mark fitted = *mark;
    if (!fit_coarse(refine, frame, &view, mark->white) ||
        !fit_fine(refine, frame, &view, &fitted) || !is_clean(refine, &fitted)) {
        return false;
    }
    *mark = fitted;
    return true;
}

static void place_patch(const struct patches *patches, const struct patch *patch,
                        struct pattern_patch *pattern)
{
    const struct target *target = patches->settings.target;
    uint16_t row = 0;
    uint16_t col = 0;
    uint8_t turn = 0;
    if (target != NULL && !target_find(target, patch->id, &row, &col, &turn)) {
        target = NULL;
    }
    *pattern = (struct pattern_patch){
        .target = target,
        .levels = patches->settings.levels,
        .id = patch->id,
        .row = row,
        .col = col,
        .turned = turn != 0,
    };
}

/* Tells every circle of the patch, from where they were found so far, what is printed around it, and how sharp
 * the anchor says that edges are. */
static void describe_patch(struct refine *refine, const struct patch *patch,
                           const struct pattern_patch *pattern)
{
    const int32_t anchor_blur =
        patch->marks[LAYOUT_ANCHOR] != MARKS_NONE ? refine->views[LAYOUT_ANCHOR].blur_px_q16 : 0;
    uint32_t count = 0;
    for (unsigned i = 0; i < LAYOUT_FEATURES_LEVEL2; i++) {
        if (patch->marks[i] != MARKS_NONE) {
            const struct layout_feature *f = layout_feature(pattern->levels, i);
            struct boardmap_pair *pair = &refine->pairs[count++];
            pattern_to_board(pattern, f->u_q30 >> 6, f->v_q30 >> 6, &pair->u_q24, &pair->v_q24);
            pair->x_px_q16 = refine->views[i].ellipse.x_px_q16;
            pair->y_px_q16 = refine->views[i].ellipse.y_px_q16;
        }
    }
    struct boardmap map;
    const bool mapped = boardmap_fit(refine->pairs, count, &map);
    for (unsigned i = 0; i < LAYOUT_FEATURES_MAX; i++) {
        if (patch->marks[i] != MARKS_NONE && mapped) {
            pattern_edges_of(pattern, i, &map, &refine->views[i].edges);
            refine->views[i].edge_blur_px_q16 =
                anchor_blur > 0 ? anchor_blur : refine->views[i].blur_px_q16;
        }
    }
}

/* The value that half of the counted ones do not exceed. */
static uint32_t median_bin(const uint32_t bins[NOISE_BINS], uint32_t count)
{
    uint32_t below = 0;
    for (uint32_t bin = 0; bin < NOISE_BINS; bin++) {
        below += bins[bin];
        if (2 * below >= count) {
            return bin;
        }
    }
    return NOISE_BINS - 1;
}

/* Takes a feature out of its patch. */
static void refuse(struct refine *refine, struct patch *patch, unsigned feature)
{
    patch->marks[feature] = MARKS_NONE;
    patch->feature_count--;
    refine->refused++;
}

/* The slopes of the plane through the brightness around those circles that are white (their triangles black)
 * or black: least squares about the means. False for circles that are few or nearly stand on a line. */
static bool fit_slopes(const struct marks *marks, const uint32_t near[], uint32_t near_count,
                       bool white, int32_t slope_q30[2])
{
    int64_t mean_x = 0;
    int64_t mean_y = 0;
    int64_t mean = 0;
    int64_t count = 0;
    for (uint32_t i = 0; i < near_count; i++) {
        const struct mark *mark = &marks->at[near[i]];
        if (mark->contrast_q30 != 0 && mark->white == white) {
            mean_x += mark->ellipse.x_px_q16;
            mean_y += mark->ellipse.y_px_q16;
            mean += mark->level_q30;
            count++;
        }
    }
    if (count < LIGHT_CIRCLES_MIN) {
        return false;
    }
    mean_x /= count;
    mean_y /= count;
    mean /= count;
    struct smallsolve normal = {.size = 2};
    int64_t right[2] = {0};
    for (uint32_t i = 0; i < near_count; i++) {
        const struct mark *mark = &marks->at[near[i]];
        if (mark->contrast_q30 == 0 || mark->white != white) {
            continue;
        }
        const int64_t x = (mark->ellipse.x_px_q16 - mean_x) * LIGHT_SCALE;
        const int64_t y = (mark->ellipse.y_px_q16 - mean_y) * LIGHT_SCALE;
        if (fx_abs_i64(x) > (int64_t)1 << 31 || fx_abs_i64(y) > (int64_t)1 << 31) {
            return false;
        }
        normal.at_q30[0][0] += fx_mul_q30(x, x) / count;
        normal.at_q30[1][0] += fx_mul_q30(x, y) / count;
        normal.at_q30[1][1] += fx_mul_q30(y, y) / count;
        right[0] += fx_mul_q30(x, mark->level_q30 - mean) / count;
        right[1] += fx_mul_q30(y, mark->level_q30 - mean) / count;
    }
    if (!smallsolve_factor(&normal, LIGHT_PIVOT_Q30) || !smallsolve_solve(&normal, right)) {
        return false;
    }
    for (unsigned axis = 0; axis < 2; axis++) {
        const int64_t slope = fx_round_shift_i64(right[axis], 10);
        if (fx_abs_i64(slope) > LIGHT_LIMIT_Q30) {
            return false;
        }
        slope_q30[axis] = (int32_t)slope;
    }
    return true;
}

/* How the light falls on a patch: from what the first fits say of black and white there and around. */
static void find_light(struct refine *refine, struct patch *patch, const struct marks *marks)
{
    struct patch_light light = {0};
    if (patch->marks[LAYOUT_ANCHOR] == MARKS_NONE) {
        return;
    }
    const struct mark *anchor = &marks->at[patch->marks[LAYOUT_ANCHOR]];
    const uint32_t count =
        marks_near(marks, anchor->ellipse.x_px_q16, anchor->ellipse.y_px_q16,
                   fx_saturate_u16(anchor->size_px_q16 >> 10) * (LIGHT_REACH_SIZES << 10),
                   refine->near, LIGHT_NEAR_MAX);
    if (fit_slopes(marks, refine->near, count, true, light.black_slope_q30) &&
        fit_slopes(marks, refine->near, count, false, light.white_slope_q30)) {
        patch->light = light;
    }
}

struct blur_sums {
    int64_t  all_q16;
    int64_t  anchors_q16;
    uint32_t anchors;
};

/* The first step of all circles of a patch, kept in their marks. */
static void refine_coarsely(struct refine *refine, const struct frame_view *frame,
                            const struct patches *patches, struct patch *patch, struct marks *marks)
{
    struct pattern_patch pattern;
    place_patch(patches, patch, &pattern);
    for (unsigned i = 0; i < LAYOUT_FEATURES_MAX; i++) {
        if (patch->marks[i] != MARKS_NONE &&
            (!start_view(refine, &marks->at[patch->marks[i]], &refine->views[i]) ||
             !estimate_blur(refine, frame, &marks->at[patch->marks[i]], &refine->views[i]))) {
            refuse(refine, patch, i);
        }
    }
    describe_patch(refine, patch, &pattern);
    for (unsigned i = 0; i < LAYOUT_FEATURES_MAX; i++) {
        if (patch->marks[i] == MARKS_NONE) {
            continue;
        }
        struct mark *mark = &marks->at[patch->marks[i]];
        const struct rim_view *view = &refine->views[i];
        if (fit_coarse(refine, frame, &refine->views[i], mark->white)) {
            mark->ellipse = view->ellipse;
            mark->size_px_q16 = view->size_px_q16;
            mark->blur_px_q16 = view->blur_px_q16;
            mark->level_q30 = fx_saturate_i32(view->level_q30);
            mark->contrast_q30 = fx_saturate_i32(view->contrast_q30);
        } else {
            refuse(refine, patch, i);
        }
    }
}

/* The second step, with what all circles around have said of edges and light; gathers noise and blur. */
static void refine_finely(struct refine *refine, const struct frame_view *frame,
                          const struct patches *patches, struct patch *patch, struct marks *marks,
                          uint32_t bins[NOISE_BINS], struct blur_sums *sums)
{
    struct pattern_patch pattern;
    place_patch(patches, patch, &pattern);
    for (unsigned i = 0; i < LAYOUT_FEATURES_MAX; i++) {
        if (patch->marks[i] == MARKS_NONE) {
            continue;
        }
        const struct mark *mark = &marks->at[patch->marks[i]];
        struct rim_view *view = &refine->views[i];
        if (!start_view(refine, mark, view)) {
            refuse(refine, patch, i);
        }
        view->blur_px_q16 = mark->blur_px_q16;
        view->level_q30 = mark->level_q30;
        view->contrast_q30 = mark->contrast_q30;
        view->fine = true;
    }
    describe_patch(refine, patch, &pattern);
    find_light(refine, patch, marks);
    for (unsigned i = 0; i < LAYOUT_FEATURES_MAX; i++) {
        if (patch->marks[i] == MARKS_NONE) {
            continue;
        }
        struct mark *mark = &marks->at[patch->marks[i]];
        struct rim_view *view = &refine->views[i];
        tilt_light(refine, &patch->light, mark->white, view);
        if (fit_fine(refine, frame, view, mark)) {
            const uint32_t bin = mark->noise_q16 / NOISE_BIN_Q16;
            bins[bin < NOISE_BINS ? bin : NOISE_BINS - 1]++;
            sums->all_q16 += view->blur_px_q16;
            if (i == LAYOUT_ANCHOR) {
                sums->anchors_q16 += view->blur_px_q16;
                sums->anchors++;
            }
            refine->refined++;
        } else {
            refuse(refine, patch, i);
        }
    }
}

void refine_marks(struct refine *refine, const struct frame_view *frame, struct patches *patches,
                  struct marks *marks)
{
    uint32_t bins[NOISE_BINS] = {0};
    struct blur_sums blurs = {0};
    refine->refined = 0;
    refine->refused = 0;
    refine->blur_px_q16 = 0;
    refine->noise_max_q16 = 0;
    refine->worst_max_q16 = 0;
    for (uint32_t i = 0; i < patches->count; i++) {
        refine_coarsely(refine, frame, patches, &patches->at[i], marks);
    }
    for (uint32_t i = 0; i < patches->count; i++) {
        refine_finely(refine, frame, patches, &patches->at[i], marks, bins, &blurs);
    }
    if (refine->refined == 0) {
        return;
    }
    refine->blur_px_q16 = (int32_t)(blurs.all_q16 / refine->refined);
    refine->edge_blur_px_q16 =
        blurs.anchors > 0 ? (int32_t)(blurs.anchors_q16 / blurs.anchors) : refine->blur_px_q16;
    /* A circle with a tenth of its rim covered leaves a residual of 0.3 of its contrast. */
    const uint32_t median_q16 = (median_bin(bins, refine->refined) + 1) * NOISE_BIN_Q16;
    refine->noise_max_q16 = NOISE_SHARE * median_q16 + NOISE_SLACK_Q16;
    refine->worst_max_q16 = WORST_SHARE * median_q16 + WORST_SLACK_Q16;
    for (uint32_t i = 0; i < patches->count; i++) {
        struct patch *patch = &patches->at[i];
        for (unsigned feature = 0; feature < LAYOUT_FEATURES_MAX; feature++) {
            if (patch->marks[feature] != MARKS_NONE &&
                !is_clean(refine, &marks->at[patch->marks[feature]])) {
                refuse(refine, patch, feature);
            }
        }
    }
}
