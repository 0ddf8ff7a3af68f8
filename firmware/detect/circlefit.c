/* See circlefit.h. Unit-frame coordinates are Q24; Jacobian entries Q20; brightness is in units of 4096
 * grey_q4, Q30, the second pass 2^RIM_FINE_BITS times finer. */
#include "firmware/detect/circlefit.h"

#include "common/fx/fx.h"
#include "common/fx/root.h"
#include "common/fx/smallsolve.h"
#include "firmware/detect/luma.h"
#include "firmware/detect/profile.h"

#define BLUR_MIN_PX_Q16   26214 /* 0.4 */
#define BLUR_MAX_PX_Q16   262144 /* 4 */
/* Peaks, in radii: narrower ones are points, wider ones flat. */
#define PEAK_MIN_Q16      1024u /* 1/64 */
#define PEAK_MAX_Q16      (8u << 16)
#define PIVOT_FLOOR_Q30   ((int64_t)1 << 12)
#define CONTRAST_MIN_Q30  ((int64_t)1 << 23) /* 2 grey levels of 256 */
#define CONTRAST_MAX_Q30  ((int64_t)2 << 30) /* more than any frame has */
#define OCTANT_PIXELS_MIN 4u
#define GROWTH_MAX_Q36    ((int64_t)3 << 32) /* three sixteenths */
/* Smaller circles are placed by their noise; and what is known no better than this may be 0.3 px off. */
#define SIZE_SIGMAS_Q8    425   /* 1.66 */
#define SIGMA_MAX_PX_Q20  62914 /* 0.06 */
#define NARROW_SIGMAS_Q16 98304 /* 1.5 */
/* The band of 2 blurs and the 3.25 from which edges are felt (rim.c). */
#define ROOMY_SIGMAS_Q8   1344
#define HELD_SIGMAS       3
#define HELD_Q30          FX_Q(0.1, 30)
#define COARSE_STEPS      2u
#define COARSE_FAR_SHARE  5
#define BLUR_FAR_SHARE    3
#define FINE_STEPS        3u
#define FINE_FAR_SHARE    12
#define UNEVEN_FAR_SHARE  200
/* A circle nearer than this to its triangle's edges, in blurs, is drawn towards them by more than it can
 * say: 0.3 px at 1.4. */
#define GAP_SIGMAS_Q8     230 /* 0.9 */

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

void circlefit_init(struct circlefit *fit, struct arena *arena, const struct dsp_kernels *dsp,
                    const struct patches_settings *settings, uint32_t kernel_sigma_px_q16)
{
    fit->rim.dsp = dsp;
    fit->rim.pixels = arena_take(arena, 1, sizeof(struct rimrow_batch));
    fit->circle_ratio_q16 = settings->circle_ratio_q16;
    fit->kernel_sigma_px_q16 = kernel_sigma_px_q16;

    /* level(rho) = e + (1 - e) exp(-rho^2 / 2 sigma^2), over level(1). */
    const int64_t edge_q15 = settings->edge_level_q16 / 2;
    const uint32_t narrow_q16 = settings->gauss_sigma_q16 > PEAK_MIN_Q16 ? settings->gauss_sigma_q16 : PEAK_MIN_Q16;
    const uint32_t sigma_q16 = narrow_q16 < PEAK_MAX_Q16 ? narrow_q16 : PEAK_MAX_Q16;
    const int64_t over_q16 = ((int64_t)1 << 32) / sigma_q16;
    int64_t rim_q15 = edge_q15 + (((32768 - edge_q15) * exp_q15(over_q16)) >> 15);
    rim_q15 = rim_q15 > 0 ? rim_q15 : 1; /* a target may state circles that have no edge at all */
    fit->rim.over_rim_q15 = ((int64_t)1 << 30) / rim_q15;
    fit->rim.edge_q15 = edge_q15;
    fit->rim.gauss_sigma_q16 = sigma_q16;
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

/* The centre is eliminated last, so that its covariance can be read off the factors. */
static const uint8_t place_of[RIM_UNKNOWNS] = {6, 7, 0, 1, 2, 3, 4, 5};

/* On a circle of a few blurs, size, contrast and blur can stand for one another. There the blur is held at the
 * one that large circles tell, as if another rim like this had measured it. False where it is free; else the step
 * that would lead there, on the solution's scale, which is `contrast_q30`'s. */
static bool is_blur_held(const struct rim_view *view, int64_t contrast_q30, int64_t *step_q30)
{
    const int64_t blur_px_q16 = view->edge_blur_px_q16;
    if (blur_px_q16 == 0 || view->size_px_q16 > HELD_SIGMAS * blur_px_q16) {
        return false;
    }
    const int64_t off_q16 = (blur_px_q16 - view->blur_px_q16) * 65536 / view->blur_px_q16;
    *step_q30 = (contrast_q30 * (off_q16 < 65536 ? off_q16 : 65536)) >> 16;
    return true;
}

static void hold_blur(const struct rim_view *view, int64_t contrast_q30, struct smallsolve *normal,
                      int64_t right_q30[RIM_UNKNOWNS])
{
    int64_t step_q30;
    if (is_blur_held(view, contrast_q30, &step_q30)) {
        normal->at_q30[place_of[RIM_BLUR]][place_of[RIM_BLUR]] += HELD_Q30;
        right_q30[place_of[RIM_BLUR]] += fx_mul_wide_q30(step_q30, HELD_Q30);
    }
}

/* One least-squares solution; factored stays for the covariance. The contrast so far is on its scale. */
static bool solve_pixels(const struct rim_view *view, const struct rim_sums *sum,
                         int64_t contrast_q30, struct smallsolve *factored,
                         int64_t solution_q30[RIM_UNKNOWNS])
{
    if (sum->count < 3 * RIM_UNKNOWNS) {
        return false;
    }
    factored->size = RIM_UNKNOWNS;
    int64_t placed_q30[RIM_UNKNOWNS];
    for (unsigned row = 0; row < RIM_UNKNOWNS; row++) {
        for (unsigned col = 0; col <= row; col++) {
            const unsigned a = place_of[row];
            const unsigned b = place_of[col];
            factored->at_q30[a > b ? a : b][a > b ? b : a] =
                fx_round_shift_i64(sum->matrix_q40[row][col] / sum->count, 10);
        }
        const int64_t right_q30 = fx_round_shift_i64(sum->right_q40[row] / sum->count, 10);
        if (fx_abs_i64(right_q30) > (int64_t)4 << 30) {
            return false;
        }
        placed_q30[place_of[row]] = right_q30;
    }
    hold_blur(view, contrast_q30, factored, placed_q30);
    if (!smallsolve_factor(factored, PIVOT_FLOOR_Q30) || !smallsolve_solve(factored, placed_q30)) {
        return false;
    }
    for (unsigned i = 0; i < RIM_UNKNOWNS; i++) {
        solution_q30[i] = placed_q30[place_of[i]];
    }
    return true;
}

/* part / whole, |part| <= |whole|. The second pass's numbers are finer, up to 2^36: low bits are
 * dropped so that the product stays below 2^63. */
static int64_t part_over_whole_q30(int64_t part, int64_t whole)
{
    const unsigned bits = fx_bits_i64(whole);
    const unsigned drop = bits > 32 ? bits - 32 : 0;
    return (part >> drop) * ((int64_t)1 << 30) / (whole >> drop);
}

/* Whether a solution moves no part of the circle by more than the blur, nor the blur by more than itself; and level and
 * contrast by no more than four ranges. */
static bool is_moderate(const int64_t solution_q30[RIM_UNKNOWNS], int64_t contrast_q30)
{
    const int64_t most_q30 = fx_abs_i64(contrast_q30);
    bool moderate = true;
    for (unsigned i = 0; i < RIM_UNKNOWNS; i++) {
        const bool is_light = i == RIM_LEVEL || i == RIM_CONTRAST;
        moderate &= fx_abs_i64(solution_q30[i]) <= (is_light ? (int64_t)4 << (30 + RIM_FINE_BITS) : most_q30);
    }
    return moderate;
}

/* Applies a moderate solution whose geometric part is c theta R / s, given c on the same scale. */
static bool apply_solution(struct rim_view *view, const int64_t solution_q30[RIM_UNKNOWNS],
                           int64_t contrast_q30)
{
    /* theta = part / c * s / R. */
    const int64_t share_q24 = ((int64_t)view->blur_px_q16 << 24) / view->size_px_q16;
    int64_t step_q36[ELLIPSE_UNKNOWNS];
    for (unsigned i = 0; i < ELLIPSE_UNKNOWNS; i++) {
        const int64_t over_q30 = part_over_whole_q30(solution_q30[i], contrast_q30);
        step_q36[i] = fx_round_shift_i64(over_q30 * share_q24, 18);
    }
    /* On the way down 1 / (1 + x) is nearer to what is meant than 1 - x: a start that took the circle's contrast for
     * larger than it is, as under gamma, is too blurred by a half or more. */
    const int64_t change_q30 = part_over_whole_q30(solution_q30[RIM_BLUR], contrast_q30);
    const int64_t one_q30 = (int64_t)1 << 30;
    view->blur_px_q16 =
        (int32_t)(change_q30 < 0
                      ? ((int64_t)view->blur_px_q16 << 30) / (one_q30 - change_q30)
                      : fx_round_shift_i64(view->blur_px_q16 * (one_q30 + change_q30), 30));
    return view->blur_px_q16 >= BLUR_MIN_PX_Q16 && view->blur_px_q16 <= BLUR_MAX_PX_Q16 &&
           ellipse_step(&view->ellipse, &view->root, step_q36) && prepare_view(view);
}

/* sigma^2 = m^2 / c^2 s^2 / R^2 trace(B N^-1 B') / (2 n), m^2 the pixels' variance. noise_q52 is m^2
 * on the fine scale. */
static bool find_sigma(const struct rim_view *view, const struct rim_sums *sum,
                       const struct smallsolve *factored, int64_t noise_q52, struct mark *mark)
{
    int64_t xx_q30;
    int64_t xy_q30;
    int64_t yy_q30;
    if (!smallsolve_invert_last(factored, &xx_q30, &xy_q30, &yy_q30)) {
        return false;
    }
    const int64_t bx = ((int64_t)view->root.xx_px_q16 << 16) / view->size_px_q16;
    const int64_t by = (int64_t)view->root.yx_px_q16 * 65536 / view->size_px_q16;
    const int64_t bz = ((int64_t)view->root.yy_px_q16 << 16) / view->size_px_q16;
    const int64_t trace_q16 = fx_round_shift_i64(
        ((bx * bx + by * by) >> 16) * (xx_q30 >> 14) + 2 * ((by * bz) >> 16) * (xy_q30 >> 14) +
            ((bz * bz) >> 16) * (yy_q30 >> 14),
        16);
    if (trace_q16 <= 0 || trace_q16 > INT32_MAX) {
        return false;
    }
    /* m / c in Q30: the root is m in Q26 on the fine scale; m is below 1/16, so it is below 2^27. */
    const uint64_t contrast_q30 = (uint64_t)fx_abs_i64(view->contrast_q30);
    const uint64_t ratio_q30 = ((uint64_t)root_u64((uint64_t)noise_q52) << (34 - RIM_FINE_BITS)) / contrast_q30;
    const uint64_t spread_q24 = root_u64(((uint64_t)trace_q16 << 32) / (2u * sum->count));
    const uint64_t sigma_q20 =
        (((ratio_q30 * spread_q24) >> 20) * (uint64_t)view->blur_px_q16) >> 30;
    mark->sigma_px_q20 = (uint32_t)(sigma_q20 > UINT32_MAX ? UINT32_MAX : sigma_q20);
    mark->noise_q16 = fx_saturate_u16((int64_t)(ratio_q30 >> 14));
    return true;
}

/* What the solution x leaves of the squares, per degree of freedom, on the fine scale; Q52. Of J'J x = b it takes
 * x'b; where the blur is held, x_s (x_s - step) of what holds it more. Parts of x and of the step are at most 2^37
 * (is_moderate), those of b 2^32: in halves of their bits eight products stay below 2^61. */
static int64_t left_over_q52(const struct rim_view *view, const struct rim_sums *sum, int64_t contrast_q30,
                             const int64_t solution_q30[RIM_UNKNOWNS])
{
    int64_t left_q48 = sum->squares_q44 / sum->count * 16;
    for (unsigned i = 0; i < RIM_UNKNOWNS; i++) {
        const int64_t right_q30 = fx_round_shift_i64(sum->right_q40[i] / sum->count, 10);
        left_q48 -= (solution_q30[i] >> 6) * (right_q30 >> 6);
    }
    int64_t step_q30;
    if (is_blur_held(view, contrast_q30, &step_q30)) {
        const int64_t blur_q30 = solution_q30[RIM_BLUR];
        left_q48 -= (fx_mul_wide_q30(blur_q30, HELD_Q30) >> 6) * ((blur_q30 - step_q30) >> 6);
    }
    /* Rests are below 2, so that their squares' mean is below 4. */
    left_q48 = left_q48 < 0 ? 0 : left_q48 < (int64_t)4 << 48 ? left_q48 : (int64_t)4 << 48;
    return left_q48 * 16 / (sum->count - RIM_UNKNOWNS) * sum->count;
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
    /* The root is m in Q22 on the fine scale; over c in Q30. */
    const uint64_t root_q22 = root_u64((uint64_t)worst_q44);
    return fx_saturate_u16((int64_t)((root_q22 << (24 - RIM_FINE_BITS)) / (uint64_t)fx_abs_i64(view->contrast_q30)));
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
bool circlefit_estimate_blur(const struct circlefit *fit, const struct frame_view *frame,
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
    const int64_t kernel_q16 = fit->kernel_sigma_px_q16;
    const int64_t square_q32 = total_q16 * total_q16 - kernel_q16 * kernel_q16;
    int64_t blur_q16 = square_q32 > 0 ? root_u64((uint64_t)square_q32) : 0;
    blur_q16 = blur_q16 < 45875 ? 45875 : blur_q16;
    blur_q16 = blur_q16 > 163840 ? 163840 : blur_q16;
    view->blur_px_q16 = (int32_t)blur_q16;
    /* The blurred edge of a disc is steepest inside of it: its slope goes as exp(-(r - R)^2 / 2 s^2) / sqrt(r), which
     * is largest at r = R - s^2 / 2 R; and at R - 0.7 s^2 / R for one that gets brighter inwards as the printed ones do
     * (median of first steps over blurs of 1.4 to 2.3 px and radii of 3 to 12 px). The ellipse is enlarged by as
     * much. */
    const int64_t square_px2_q16 = (kernel_q16 * kernel_q16 + blur_q16 * blur_q16) >> 16;
    const int64_t size_px2_q16 = ((int64_t)view->size_px_q16 * view->size_px_q16) >> 16;
    const int64_t growth_q36 = (square_px2_q16 * FX_Q(0.7, 10) << 26) / size_px2_q16;
    const int64_t enlarged[ELLIPSE_UNKNOWNS] = {0, 0, growth_q36 < GROWTH_MAX_Q36 ? growth_q36 : GROWTH_MAX_Q36};
    return ellipse_step(&view->ellipse, &view->root, enlarged) && prepare_view(view);
}

static bool is_contrast(int64_t contrast_q30)
{
    const int64_t size_q30 = fx_abs_i64(contrast_q30);
    return size_q30 >= CONTRAST_MIN_Q30 && size_q30 <= CONTRAST_MAX_Q30;
}

/* Whether a solution moves the circle so far that its derivatives have changed. A step of d blurs leaves about
 * d^2 / 4 of one; the second pass takes that squared. */
static bool is_far(const int64_t solution_q30[RIM_UNKNOWNS], int64_t contrast_q30, int64_t share)
{
    int64_t farthest_q30 = 0;
    for (unsigned i = 0; i < ELLIPSE_UNKNOWNS; i++) {
        const int64_t part_q30 = fx_abs_i64(solution_q30[i]);
        farthest_q30 = part_q30 > farthest_q30 ? part_q30 : farthest_q30;
    }
    return share * farthest_q30 > fx_abs_i64(contrast_q30);
}

/* The first solution, from raw pixels and the blur in *view; a second time where the first led far. False where
 * there is no such circle. */
bool circlefit_coarse(const struct circlefit *fit, const struct frame_view *frame,
                      struct rim_view *view, bool white)
{
    bool far = true;
    for (unsigned step = 0; far && step < COARSE_STEPS; step++) {
        struct rim_sums sum;
        struct smallsolve factored;
        int64_t solution_q30[RIM_UNKNOWNS];
        rim_gather(&fit->rim, frame, view, &sum);
        if (!solve_pixels(view, &sum, view->contrast_q30, &factored, solution_q30)) {
            return false;
        }
        view->level_q30 = solution_q30[RIM_LEVEL];
        view->contrast_q30 = solution_q30[RIM_CONTRAST];
        /* Bright inside is positive contrast; anything else is another edge. */
        if (!is_contrast(view->contrast_q30) || (view->contrast_q30 > 0) != white ||
            !is_moderate(solution_q30, view->contrast_q30) || !apply_solution(view, solution_q30, view->contrast_q30)) {
            return false;
        }
        far = is_far(solution_q30, view->contrast_q30, COARSE_FAR_SHARE) ||
              BLUR_FAR_SHARE * fx_abs_i64(solution_q30[RIM_BLUR]) > fx_abs_i64(view->contrast_q30);
    }
    view->fine = true;
    return true;
}

/* Sigma is that of a linear fit. Where the semi-minor axis comes below a blur and a half errors are larger: twice
 * what is missing, as a share (RMS over rendered frames of noise 0 to 4). */
static uint32_t narrow_sigma_q20(uint32_t sigma_q20, uint32_t minor_px_q16, int32_t blur_px_q16)
{
    const int64_t blurs_q16 = ((int64_t)minor_px_q16 << 16) / blur_px_q16;
    const int64_t missing_q16 = blurs_q16 < NARROW_SIGMAS_Q16 ? NARROW_SIGMAS_Q16 - blurs_q16 : 0;
    return sigma_q20 + (uint32_t)(((int64_t)sigma_q20 * 2 * missing_q16) >> 16);
}

/* The second, from what the first left over; with the noise. False leaves the mark as it was. */
bool circlefit_fine(const struct circlefit *fit, const struct frame_view *frame,
                    struct rim_view *view, struct mark *mark)
{
    struct mark fitted = *mark;
    bool far = true;
    for (unsigned step = 0; far && step < FINE_STEPS; step++) {
        struct rim_sums sum;
        struct smallsolve factored;
        int64_t solution_q30[RIM_UNKNOWNS];
        rim_gather(&fit->rim, frame, view, &sum);
        const int64_t contrast_q30 = view->contrast_q30 * (1 << RIM_FINE_BITS);
        if (!solve_pixels(view, &sum, contrast_q30, &factored, solution_q30) ||
            !is_moderate(solution_q30, contrast_q30) ||
            !find_sigma(view, &sum, &factored, left_over_q52(view, &sum, contrast_q30, solution_q30), &fitted)) {
            return false;
        }
        fitted.worst_q16 = worst_octant_q16(view, &sum);
        if (!apply_solution(view, solution_q30, contrast_q30)) {
            return false;
        }
        /* The octants are judged as they were before the step: what a step explains must not count there. */
        far = is_far(solution_q30, contrast_q30, FINE_FAR_SHARE) ||
              FINE_FAR_SHARE * fx_abs_i64(solution_q30[RIM_BLUR]) > fx_abs_i64(contrast_q30) ||
              (fitted.worst_q16 > 2 * fitted.noise_q16 &&
               is_far(solution_q30, contrast_q30, UNEVEN_FAR_SHARE));
        view->level_q30 += solution_q30[RIM_LEVEL] >> RIM_FINE_BITS;
        view->contrast_q30 += solution_q30[RIM_CONTRAST] >> RIM_FINE_BITS;
        if (!is_contrast(view->contrast_q30)) {
            return false;
        }
    }
    uint32_t major_px_q16;
    uint32_t minor_px_q16;
    uint16_t angle;
    ellipse_axes(&view->ellipse, &major_px_q16, &minor_px_q16, &angle);
    fitted.sigma_px_q20 = narrow_sigma_q20(fitted.sigma_px_q20, minor_px_q16, view->blur_px_q16);
    if (fx_round_shift_i64((int64_t)minor_px_q16 * view->gap_q16, 16) <
            ((int64_t)view->blur_px_q16 * GAP_SIGMAS_Q8) >> 8 ||
        view->size_px_q16 < ((int64_t)view->blur_px_q16 * SIZE_SIGMAS_Q8) >> 8 ||
        fitted.sigma_px_q20 > SIGMA_MAX_PX_Q20) {
        return false;
    }
    fitted.ellipse = view->ellipse;
    fitted.size_px_q16 = view->size_px_q16;
    fitted.blur_px_q16 = view->blur_px_q16;
    fitted.contrast_q30 = fx_saturate_i32(view->contrast_q30);
    *mark = fitted;
    return true;
}

bool circlefit_is_roomy(const struct rim_view *view, int32_t blur_px_q16)
{
    uint32_t major_px_q16;
    uint32_t minor_px_q16;
    uint16_t angle;
    ellipse_axes(&view->ellipse, &major_px_q16, &minor_px_q16, &angle);
    return fx_round_shift_i64((int64_t)minor_px_q16 * view->gap_q16, 16) >
           ((int64_t)blur_px_q16 * ROOMY_SIGMAS_Q8) >> 8;
}

bool circlefit_start(const struct circlefit *fit, const struct mark *mark, struct rim_view *view)
{
    *view = (struct rim_view){
        .ellipse = mark->ellipse,
        .gap_q16 = ((int64_t)1 << 32) / fit->circle_ratio_q16 - 65536,
    };
    return prepare_view(view);
}
