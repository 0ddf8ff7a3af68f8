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
    light->near = arena_take(arena, 2 * LIGHT_NEAR_MAX, sizeof(uint32_t));
    light->off_q30 = arena_take(arena, LIGHT_NEAR_MAX, sizeof(int64_t));
}

static int64_t plane_at_q30(const struct plane *plane, const struct ellipse *place)
{
    const int64_t x_q12 = (place->x_px_q16 - plane->x_px_q16) >> 4;
    const int64_t y_q12 = (place->y_px_q16 - plane->y_px_q16) >> 4;
    return plane->level_q30 + ((plane->slope_q30[0] * x_q12 + plane->slope_q30[1] * y_q12) >> 12);
}

static int64_t off_plane_q30(const struct mark *mark, const struct plane *plane)
{
    return mark->level_q30 - plane_at_q30(plane, &mark->ellipse);
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
static bool fit_plane(const struct marks *marks, const uint32_t near[], uint32_t count,
                      struct plane *plane)
{
    if (count < CIRCLES_MIN) {
        return false;
    }
    int64_t mean_x = 0;
    int64_t mean_y = 0;
    int64_t mean = 0;
    for (uint32_t i = 0; i < count; i++) {
        const struct mark *mark = &marks->at[near[i]];
        mean_x += mark->ellipse.x_px_q16;
        mean_y += mark->ellipse.y_px_q16;
        mean += mark->level_q30;
    }
    *plane = (struct plane){mean_x / count, mean_y / count, mean / count, {0, 0}};
    struct smallsolve normal = {.size = 2};
    int64_t right[2] = {0};
    for (uint32_t i = 0; i < count; i++) {
        const struct mark *mark = &marks->at[near[i]];
        const int64_t x = (mark->ellipse.x_px_q16 - plane->x_px_q16) * SCALE;
        const int64_t y = (mark->ellipse.y_px_q16 - plane->y_px_q16) * SCALE;
        if (fx_abs_i64(x) > (int64_t)1 << 31 || fx_abs_i64(y) > (int64_t)1 << 31) {
            return false;
        }
        normal.at_q30[0][0] += fx_mul_q30(x, x);
        normal.at_q30[1][0] += fx_mul_q30(x, y);
        normal.at_q30[1][1] += fx_mul_q30(y, y);
        right[0] += fx_mul_q30(x, mark->level_q30 - plane->level_q30);
        right[1] += fx_mul_q30(y, mark->level_q30 - plane->level_q30);
    }
    normal.at_q30[0][0] /= count;
    normal.at_q30[1][0] /= count;
    normal.at_q30[1][1] /= count;
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

/* The plane through the brightness around those circles that are white (their triangles black) or black. The first
 * fits' levels are far off where something covers a circle: from the median level on, what does not agree is left
 * out. */
static bool fit_colour(struct light *light, const struct marks *marks, uint32_t near_count,
                       bool white, struct plane *plane)
{
    uint32_t *own = light->near + LIGHT_NEAR_MAX; /* behind the list of all */
    const uint32_t stride = near_count / NEAR_ENOUGH + 1;
    uint32_t count = 0;
    for (uint32_t i = 0; i < near_count; i += stride) {
        const struct mark *mark = &marks->at[light->near[i]];
        if (mark->contrast_q30 != 0 && mark->white == white) {
            light->off_q30[count] = mark->level_q30;
            own[count++] = light->near[i];
        }
    }
    if (count < CIRCLES_MIN) {
        return false;
    }
    *plane = (struct plane){.level_q30 = median(light->off_q30, count)};
    for (unsigned step = 0; step < STEPS; step++) {
        for (uint32_t i = 0; i < count; i++) {
            light->off_q30[i] = fx_abs_i64(off_plane_q30(&marks->at[own[i]], plane));
        }
        const int64_t limit_q30 = OFF_MEDIANS * median(light->off_q30, count) + OFF_SLACK_Q30;
        uint32_t kept = 0;
        for (uint32_t i = 0; i < count; i++) {
            if (fx_abs_i64(off_plane_q30(&marks->at[own[i]], plane)) <= limit_q30) {
                own[kept++] = own[i];
            }
        }
        const bool agreed = step > 0 && kept == count;
        count = kept;
        if (agreed) {
            break;
        }
        if (!fit_plane(marks, own, count, plane)) {
            return false;
        }
    }
    return true;
}

bool light_fit(struct light *light, const struct marks *marks, uint32_t count,
               const struct ellipse *place, struct patch_light *out)
{
    struct plane black;
    struct plane white;
    if (!fit_colour(light, marks, count, true, &black) ||
        !fit_colour(light, marks, count, false, &white)) {
        return false;
    }
    *out = (struct patch_light){
        .black_slope_q30 = {(int32_t)black.slope_q30[0], (int32_t)black.slope_q30[1]},
        .white_slope_q30 = {(int32_t)white.slope_q30[0], (int32_t)white.slope_q30[1]},
        .swing_q30 =
            fx_saturate_i32(plane_at_q30(&white, place) - plane_at_q30(&black, place)),
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
