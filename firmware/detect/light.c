/* See light.h. Offsets are in units of 2^10 px, Q30. */
#include "firmware/detect/light.h"

#include "common/fx/fx.h"
#include "common/fx/smallsolve.h"

/* Planes through black and white: six circles at least, over some ten pixels; slopes up to a 64th of the
 * range a pixel. */
#define CIRCLES_MIN 6u
#define NEAR_ENOUGH 64u /* of more, every second or third: a plane's slopes need no more */
#define REACH_SIZES 14u /* around the anchor: one patch and a half */
#define SCALE       16
#define PIVOT_Q30   ((int64_t)1 << 15)
#define LIMIT_Q30   ((int64_t)1 << 24)

/* What is off the plane by more than so many medians, and a quarter of a grey level, has something in front. */
#define OFF_MEDIANS 4
#define OFF_SLACK_Q30 ((int64_t)1 << 20)
#define STEPS 3

struct plane {
    int64_t x_px_q16;
    int64_t y_px_q16;
    int64_t level_q30; /* there */
    int64_t slope_q30[2];
};

void light_init(struct light *light, struct arena *arena)
{
    light->near = arena_take(arena, LIGHT_NEAR_MAX, sizeof(uint32_t));
    light->points = arena_take(arena, NEAR_ENOUGH, sizeof(struct light_point));
    light->off_q30 = arena_take(arena, 2 * NEAR_ENOUGH, sizeof(int64_t));
}

static int64_t plane_at_q30(const struct plane *plane, int32_t x_px_q16, int32_t y_px_q16)
{
    const int64_t x_q12 = (x_px_q16 - plane->x_px_q16) >> 4;
    const int64_t y_q12 = (y_px_q16 - plane->y_px_q16) >> 4;
    return plane->level_q30 + ((plane->slope_q30[0] * x_q12 + plane->slope_q30[1] * y_q12) >> 12);
}

/* The middle one of the values (Hoare's selection); reorders them. */
static int64_t median(int64_t values[], uint32_t count)
{
    const int64_t middle = count / 2;
    int64_t first = 0;
    int64_t last = (int64_t)count - 1;
    while (first < last) {
        const int64_t pivot = values[middle];
        int64_t i = first;
        int64_t k = last;
        while (i <= k) {
            while (values[i] < pivot) {
                i++;
            }
            while (values[k] > pivot) {
                k--;
            }
            if (i <= k) {
                const int64_t swap = values[i];
                values[i++] = values[k];
                values[k--] = swap;
            }
        }
        first = k < middle ? i : first;
        last = i > middle ? k : last;
    }
    return values[middle];
}

/* The plane through the brightness around these circles: least squares about the means. False for circles that
 * are few or nearly stand on a line. */
static bool fit_plane(const struct light_point points[], uint32_t count, struct plane *plane)
{
    if (count < CIRCLES_MIN) {
        return false;
    }
    int64_t mean_x = 0;
    int64_t mean_y = 0;
    int64_t mean = 0;
    for (uint32_t i = 0; i < count; i++) {
        mean_x += points[i].x_px_q16;
        mean_y += points[i].y_px_q16;
        mean += points[i].level_q30;
    }
    *plane = (struct plane){mean_x / count, mean_y / count, mean / count, {0, 0}};
    int64_t xx = 0;
    int64_t xy = 0;
    int64_t yy = 0;
    int64_t right[2] = {0};
    for (uint32_t i = 0; i < count; i++) {
        const int64_t x = (points[i].x_px_q16 - plane->x_px_q16) * SCALE;
        const int64_t y = (points[i].y_px_q16 - plane->y_px_q16) * SCALE;
        if (fx_abs_i64(x) > (int64_t)1 << 31 || fx_abs_i64(y) > (int64_t)1 << 31) {
            return false;
        }
        const int64_t off = points[i].level_q30 - plane->level_q30;
        xx += fx_mul_q30(x, x);
        xy += fx_mul_q30(x, y);
        yy += fx_mul_q30(y, y);
        right[0] += fx_mul_q30(x, off);
        right[1] += fx_mul_q30(y, off);
    }
    struct smallsolve normal;
    normal.size = 2;
    normal.at_q30[0][0] = xx / count;
    normal.at_q30[1][0] = xy / count;
    normal.at_q30[1][1] = yy / count;
    right[0] /= count;
    right[1] /= count;
    if (!smallsolve_factor(&normal, PIVOT_Q30) || !smallsolve_solve(&normal, right)) {
        return false;
    }
    plane->slope_q30[0] = fx_round_shift_i64(right[0], 10);
    plane->slope_q30[1] = fx_round_shift_i64(right[1], 10);
    return fx_abs_i64(plane->slope_q30[0]) <= LIMIT_Q30 &&
           fx_abs_i64(plane->slope_q30[1]) <= LIMIT_Q30;
}

/* The plane through the brightness around circles of one colour; reorders them. The first fits' levels are far off
 * where something covers a circle: from the median level on, what does not agree is left out. off_q30: room for twice
 * as many. */
static bool fit_colour(struct light_point points[], uint32_t count, int64_t off_q30[], struct plane *plane)
{
    if (count < CIRCLES_MIN) {
        return false;
    }
    for (uint32_t i = 0; i < count; i++) {
        off_q30[i] = points[i].level_q30;
    }
    *plane = (struct plane){.level_q30 = median(off_q30, count)};
    int64_t *sorted_q30 = off_q30 + NEAR_ENOUGH;
    for (unsigned step = 0; step < STEPS; step++) {
        for (uint32_t i = 0; i < count; i++) {
            off_q30[i] = fx_abs_i64(points[i].level_q30 -
                                    plane_at_q30(plane, points[i].x_px_q16, points[i].y_px_q16));
            sorted_q30[i] = off_q30[i];
        }
        const int64_t limit_q30 = OFF_MEDIANS * median(sorted_q30, count) + OFF_SLACK_Q30;
        uint32_t kept = 0;
        for (uint32_t i = 0; i < count; i++) {
            if (off_q30[i] <= limit_q30) {
                points[kept++] = points[i];
            }
        }
        const bool agreed = step > 0 && kept == count;
        count = kept;
        if (agreed) {
            break;
        }
        if (!fit_plane(points, count, plane)) {
            return false;
        }
    }
    return true;
}

/* Copies white circles, whose triangles are black, to the front of the list, black ones to its back. */
static void part_colours(struct light *light, const struct marks *marks, uint32_t near_count,
                         uint32_t *white_count, uint32_t *black_count)
{
    const uint32_t stride = near_count / NEAR_ENOUGH + 1;
    *white_count = 0;
    *black_count = 0;
    for (uint32_t i = 0; i < near_count; i += stride) {
        const struct mark *mark = &marks->at[light->near[i]];
        if (mark->contrast_q30 != 0) {
            const uint32_t at = mark->white ? (*white_count)++ : NEAR_ENOUGH - ++*black_count;
            light->points[at] = (struct light_point){mark->ellipse.x_px_q16, mark->ellipse.y_px_q16,
                                                     mark->level_q30};
        }
    }
}

bool light_fit(struct light *light, const struct marks *marks, uint32_t count,
               const struct ellipse *place, struct patch_light *out)
{
    struct plane black;
    struct plane white;
    uint32_t on_black;
    uint32_t on_white;
    part_colours(light, marks, count, &on_black, &on_white);
    if (!fit_colour(light->points, on_black, light->off_q30, &black) ||
        !fit_colour(light->points + (NEAR_ENOUGH - on_white), on_white, light->off_q30, &white)) {
        return false;
    }
    *out = (struct patch_light){
        .black_slope_q30 = {(int32_t)black.slope_q30[0], (int32_t)black.slope_q30[1]},
        .white_slope_q30 = {(int32_t)white.slope_q30[0], (int32_t)white.slope_q30[1]},
        .swing_q30 =
            fx_saturate_i32(plane_at_q30(&white, place->x_px_q16, place->y_px_q16) -
                            plane_at_q30(&black, place->x_px_q16, place->y_px_q16)),
    };
    return true;
}

/* How the light falls on a patch: from what the first fits say of black and white there and around. */
void light_find(struct light *light, struct patch *patch, const struct marks *marks)
{
    if (patch->marks[LAYOUT_ANCHOR] == MARKS_NONE) {
        return;
    }
    const struct mark *anchor = &marks->at[patch->marks[LAYOUT_ANCHOR]];
    const uint32_t count =
        marks_near(marks, anchor->ellipse.x_px_q16, anchor->ellipse.y_px_q16,
                   fx_saturate_u16(anchor->size_px_q16 >> 10) * (REACH_SIZES << 10),
                   light->near, LIGHT_NEAR_MAX);
    (void)light_fit(light, marks, count, &anchor->ellipse, &patch->light);
}

/* What is printed in a shade between black and white is seen in one, and its slope lies between theirs as its
 * brightness does, whatever curve the camera has put between them. So a circle's contrast changes by the share that
 * it is of the full swing. */
void light_tilt(const struct patch_light *light, bool white, struct rim_view *view)
{
    for (unsigned axis = 0; axis < 2; axis++) {
        const int64_t black_q30 = light->black_slope_q30[axis];
        const int64_t white_q30 = light->white_slope_q30[axis];
        view->level_slope_q30[axis] = white ? black_q30 : white_q30;
        view->contrast_slope_q30[axis] =
            light->swing_q30 > 0 ? (white_q30 - black_q30) * view->contrast_q30 / light->swing_q30 : 0;
    }
}
