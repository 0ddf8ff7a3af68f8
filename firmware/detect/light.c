/* See light.h. Offsets are in units of 2^10 px, Q30. */
#include "firmware/detect/light.h"

#include "common/fx/fx.h"
#include "common/fx/smallsolve.h"

/* Planes through black and white: six circles at least, over some ten pixels; slopes up to a 64th of the
 * range a pixel. */
#define CIRCLES_MIN 6u
#define NEAR_MAX    256u
#define REACH_SIZES 14u /* around the anchor: one patch and a half */
#define SCALE       16
#define PIVOT_Q30   ((int64_t)1 << 15)
#define LIMIT_Q30   ((int64_t)1 << 24)

void light_init(struct light *light, struct arena *arena)
{
    light->near = arena_take(arena, NEAR_MAX, sizeof(uint32_t));
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
    if (count < CIRCLES_MIN) {
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
        const int64_t x = (mark->ellipse.x_px_q16 - mean_x) * SCALE;
        const int64_t y = (mark->ellipse.y_px_q16 - mean_y) * SCALE;
        if (fx_abs_i64(x) > (int64_t)1 << 31 || fx_abs_i64(y) > (int64_t)1 << 31) {
            return false;
        }
        normal.at_q30[0][0] += fx_mul_q30(x, x) / count;
        normal.at_q30[1][0] += fx_mul_q30(x, y) / count;
        normal.at_q30[1][1] += fx_mul_q30(y, y) / count;
        right[0] += fx_mul_q30(x, mark->level_q30 - mean) / count;
        right[1] += fx_mul_q30(y, mark->level_q30 - mean) / count;
    }
    if (!smallsolve_factor(&normal, PIVOT_Q30) || !smallsolve_solve(&normal, right)) {
        return false;
    }
    for (unsigned axis = 0; axis < 2; axis++) {
        const int64_t slope = fx_round_shift_i64(right[axis], 10);
        if (fx_abs_i64(slope) > LIMIT_Q30) {
            return false;
        }
        slope_q30[axis] = (int32_t)slope;
    }
    return true;
}

/* How the light falls on a patch: from what the first fits say of black and white there and around. */
void light_find(struct light *light, struct patch *patch, const struct marks *marks)
{
    struct patch_light slopes = {0};
    if (patch->marks[LAYOUT_ANCHOR] == MARKS_NONE) {
        return;
    }
    const struct mark *anchor = &marks->at[patch->marks[LAYOUT_ANCHOR]];
    const uint32_t count =
        marks_near(marks, anchor->ellipse.x_px_q16, anchor->ellipse.y_px_q16,
                   fx_saturate_u16(anchor->size_px_q16 >> 10) * (REACH_SIZES << 10),
                   light->near, NEAR_MAX);
    if (fit_slopes(marks, light->near, count, true, slopes.black_slope_q30) &&
        fit_slopes(marks, light->near, count, false, slopes.white_slope_q30)) {
        patch->light = slopes;
    }
}

/* A black circle goes from white (b) to rim_level of the way to black; a white one the other way. */
void light_tilt(const struct patch_light *light, int64_t over_rim_q15, bool white,
                struct rim_view *view)
{
    for (unsigned axis = 0; axis < 2; axis++) {
        const int64_t outside = white ? light->black_slope_q30[axis] : light->white_slope_q30[axis];
        const int64_t inside = white ? light->white_slope_q30[axis] : light->black_slope_q30[axis];
        view->level_slope_q30[axis] = outside;
        view->contrast_slope_q30[axis] = (inside - outside) * 32768 / over_rim_q15;
    }
}
