/* See light.h. Surfaces of second order through what circles say, level = sum of terms; of first order where the
 * circles are few or tell no more than that. */
#include "firmware/detect/light.h"

#include "common/fx/fx.h"
#include "common/fx/smallsolve.h"

#define CIRCLES_MIN 6u
#define CIRCLES_BENT 10u /* from here on the second order is fitted */
#define NEAR_ENOUGH 64u  /* of as many and more, every second, third or so: a surface needs no more */
#define REACH_SIZES 16u  /* around the anchor: nearly two patches */
/* Coordinates are at most 1. Circles on two lines, or nearly, have pivots below. */
#define PIVOT_FLAT_Q30 ((int64_t)1 << 20)
#define PIVOT_BENT_Q30 ((int64_t)1 << 18)
#define REACH_MIN_PX_Q16 ((int64_t)4 << 16)
/* Of a range of 1, with coordinates up to 1; and where a surface is asked for beyond its circles. */
#define TERM_MAX_Q30   ((int64_t)2 << 30)
#define BEYOND_MAX_Q30 ((int64_t)5 << 28)
/* From black to white two grey levels of 256 at least. */
#define SWING_MIN_Q30 ((int64_t)1 << 23)
/* Slopes up to a 64th of the range a pixel. */
#define LIMIT_Q30   ((int64_t)1 << 24)

/* What is off the surface by more than so many medians, and a quarter of a grey level, has something in front. */
#define OFF_MEDIANS 4
#define OFF_SLACK_Q30 ((int64_t)1 << 20)
#define STEPS 3

#define TERMS_FLAT 3u /* 1, x, y                 */
#define TERMS_BENT 6u /* and x x, x y, y y       */

/* level = sum of terms, with x and y from the middle in units of 2^14 px over 2^lift. */
struct surface {
    int64_t  x_px_q16;
    int64_t  y_px_q16;
    unsigned lift;
    int64_t  terms_q30[TERMS_BENT];
};

void light_init(struct light *light, struct arena *arena)
{
    light->near = arena_take(arena, LIGHT_NEAR_MAX, sizeof(uint32_t));
    light->points = arena_take(arena, NEAR_ENOUGH, sizeof(struct light_point));
    light->off_q30 = arena_take(arena, 2 * NEAR_ENOUGH, sizeof(int64_t));
}

static void fill_terms(const struct surface *surface, int32_t x_px_q16, int32_t y_px_q16, int64_t terms_q30[TERMS_BENT])
{
    const int64_t unit = (int64_t)1 << surface->lift;
    const int64_t x_q30 = (x_px_q16 - surface->x_px_q16) * unit;
    const int64_t y_q30 = (y_px_q16 - surface->y_px_q16) * unit;
    terms_q30[0] = (int64_t)1 << 30;
    terms_q30[1] = x_q30;
    terms_q30[2] = y_q30;
    terms_q30[3] = fx_mul_q30(x_q30, x_q30);
    terms_q30[4] = fx_mul_q30(x_q30, y_q30);
    terms_q30[5] = fx_mul_q30(y_q30, y_q30);
}

static int64_t surface_at_q30(const struct surface *surface, int32_t x_px_q16, int32_t y_px_q16)
{
    int64_t place_q30[TERMS_BENT];
    fill_terms(surface, x_px_q16, y_px_q16, place_q30);
    int64_t sum_q30 = 0;
    for (unsigned k = 0; k < TERMS_BENT; k++) {
        sum_q30 += fx_mul_q30(surface->terms_q30[k], place_q30[k]);
    }
    return sum_q30;
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

/* The middle of the circles, and the unit in which they reach as far as 1. False where they are all in one place. */
static bool place_surface(const struct light_point points[], uint32_t count, struct surface *surface)
{
    *surface = (struct surface){0};
    for (uint32_t i = 0; i < count; i++) {
        surface->x_px_q16 += points[i].x_px_q16;
        surface->y_px_q16 += points[i].y_px_q16;
    }
    surface->x_px_q16 /= count;
    surface->y_px_q16 /= count;
    int64_t reach_px_q16 = 0;
    for (uint32_t i = 0; i < count; i++) {
        const int64_t dx = fx_abs_i64(points[i].x_px_q16 - surface->x_px_q16);
        const int64_t dy = fx_abs_i64(points[i].y_px_q16 - surface->y_px_q16);
        reach_px_q16 = dx > reach_px_q16 ? dx : reach_px_q16;
        reach_px_q16 = dy > reach_px_q16 ? dy : reach_px_q16;
    }
    surface->lift = 30 - fx_bits_i64(reach_px_q16);
    return reach_px_q16 >= REACH_MIN_PX_Q16;
}

/* The surface of so many terms through the brightness around these circles: least squares. False where they do not
 * tell it. */
static bool fit_terms(const struct light_point points[], uint32_t count, unsigned terms, int64_t pivot_q30,
                      struct surface *surface)
{
    struct smallsolve normal;
    int64_t right_q30[TERMS_BENT] = {0};
    for (unsigned row = 0; row < terms; row++) {
        for (unsigned col = 0; col <= row; col++) {
            normal.at_q30[row][col] = 0;
        }
    }
    for (uint32_t i = 0; i < count; i++) {
        int64_t at_q30[TERMS_BENT];
        fill_terms(surface, points[i].x_px_q16, points[i].y_px_q16, at_q30);
        for (unsigned row = 0; row < terms; row++) {
            for (unsigned col = 0; col <= row; col++) {
                normal.at_q30[row][col] += fx_mul_q30(at_q30[row], at_q30[col]);
            }
            right_q30[row] += fx_mul_q30(at_q30[row], points[i].level_q30);
        }
    }
    normal.size = terms;
    for (unsigned row = 0; row < terms; row++) {
        for (unsigned col = 0; col <= row; col++) {
            normal.at_q30[row][col] /= count;
        }
        right_q30[row] /= count;
    }
    if (!smallsolve_factor(&normal, pivot_q30) || !smallsolve_solve(&normal, right_q30)) {
        return false;
    }
    bool possible = true;
    for (unsigned k = 0; k < TERMS_BENT; k++) {
        surface->terms_q30[k] = k < terms ? right_q30[k] : 0;
        possible &= fx_abs_i64(surface->terms_q30[k]) <= TERM_MAX_Q30;
    }
    return possible;
}

/* The sum of the squares that a surface leaves, Q40. */
static int64_t squares_q40(const struct light_point points[], uint32_t count, const struct surface *surface)
{
    int64_t sum_q40 = 0;
    for (uint32_t i = 0; i < count; i++) {
        const int64_t off_q30 =
            points[i].level_q30 - surface_at_q30(surface, points[i].x_px_q16, points[i].y_px_q16);
        sum_q40 += (off_q30 >> 10) * (off_q30 >> 10);
    }
    return sum_q40;
}

/* A plane, unless the second order takes more of the squares than chance would: its three terms' share is four times
 * that of others' (Fisher's F; one in a hundred by chance). */
static bool fit_surface(const struct light_point points[], uint32_t count, bool bent, struct surface *surface)
{
    if (count < CIRCLES_MIN || !place_surface(points, count, surface) ||
        !fit_terms(points, count, TERMS_FLAT, PIVOT_FLAT_Q30, surface)) {
        return false;
    }
    struct surface curved = *surface;
    if (bent && count >= CIRCLES_BENT && fit_terms(points, count, TERMS_BENT, PIVOT_BENT_Q30, &curved)) {
        const int64_t free = (int64_t)count - TERMS_BENT;
        if (squares_q40(points, count, surface) * free > squares_q40(points, count, &curved) * (free + 12)) {
            *surface = curved;
        }
    }
    return true;
}

/* The surface through the brightness around circles of one colour; reorders them. The first fits' levels are far off
 * where something covers a circle: from the median level on, then a plane, what does not agree is left out. off_q30:
 * room for twice as many. */
static bool fit_colour(struct light_point points[], uint32_t count, int64_t off_q30[], struct surface *surface)
{
    if (count < CIRCLES_MIN) {
        return false;
    }
    for (uint32_t i = 0; i < count; i++) {
        off_q30[i] = points[i].level_q30;
    }
    *surface = (struct surface){.terms_q30 = {median(off_q30, count)}};
    int64_t *sorted_q30 = off_q30 + NEAR_ENOUGH;
    for (unsigned step = 0; step < STEPS; step++) {
        for (uint32_t i = 0; i < count; i++) {
            off_q30[i] = fx_abs_i64(points[i].level_q30 -
                                    surface_at_q30(surface, points[i].x_px_q16, points[i].y_px_q16));
            sorted_q30[i] = off_q30[i];
        }
        const int64_t limit_q30 = OFF_MEDIANS * median(sorted_q30, count) + OFF_SLACK_Q30;
        uint32_t kept = 0;
        for (uint32_t i = 0; i < count; i++) {
            if (off_q30[i] <= limit_q30) {
                points[kept++] = points[i];
            }
        }
        const bool agreed = step > 1 && kept == count;
        count = kept;
        if (agreed) {
            break;
        }
        if (!fit_surface(points, count, step > 0, surface)) {
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

/* What a surface does about a place. */
static bool take_shade(const struct surface *surface, const struct ellipse *place, struct patch_shade *out)
{
    if (fx_abs_i64(place->x_px_q16 - surface->x_px_q16) > BEYOND_MAX_Q30 >> surface->lift ||
        fx_abs_i64(place->y_px_q16 - surface->y_px_q16) > BEYOND_MAX_Q30 >> surface->lift) {
        return false;
    }
    int64_t at_q30[TERMS_BENT];
    fill_terms(surface, place->x_px_q16, place->y_px_q16, at_q30);
    const int64_t *terms = surface->terms_q30;
    const int64_t by_x_q30 = terms[1] + 2 * fx_mul_q30(terms[3], at_q30[1]) + fx_mul_q30(terms[4], at_q30[2]);
    const int64_t by_y_q30 = terms[2] + fx_mul_q30(terms[4], at_q30[1]) + 2 * fx_mul_q30(terms[5], at_q30[2]);
    /* A pixel is 2^(lift - 14) units. */
    const unsigned down = 14 - surface->lift;
    const int64_t slope_q30[2] = {by_x_q30 >> down, by_y_q30 >> down};
    if (fx_abs_i64(slope_q30[0]) > LIMIT_Q30 || fx_abs_i64(slope_q30[1]) > LIMIT_Q30) {
        return false;
    }
    *out = (struct patch_shade){
        .slope_q30 = {(int32_t)slope_q30[0], (int32_t)slope_q30[1]},
        .bend_q40 = {fx_saturate_i32(fx_scale_i64(2 * terms[3], 10 - 2 * (int)down)),
                     fx_saturate_i32(fx_scale_i64(terms[4], 10 - 2 * (int)down)),
                     fx_saturate_i32(fx_scale_i64(2 * terms[5], 10 - 2 * (int)down))},
    };
    return true;
}

bool light_fit(struct light *light, const struct marks *marks, uint32_t count,
               const struct ellipse *place, struct patch_light *out)
{
    struct surface black;
    struct surface white;
    uint32_t on_black;
    uint32_t on_white;
    struct patch_light found = {.x_px_q16 = place->x_px_q16, .y_px_q16 = place->y_px_q16};
    part_colours(light, marks, count, &on_black, &on_white);
    if (!fit_colour(light->points, on_black, light->off_q30, &black) ||
        !fit_colour(light->points + (NEAR_ENOUGH - on_white), on_white, light->off_q30, &white) ||
        !take_shade(&black, place, &found.black) || !take_shade(&white, place, &found.white)) {
        return false;
    }
    found.swing_q30 = fx_saturate_i32(surface_at_q30(&white, place->x_px_q16, place->y_px_q16) -
                                      surface_at_q30(&black, place->x_px_q16, place->y_px_q16));
    *out = found;
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

/* The slope along one axis, so far from the place that it is known of. */
static int64_t slope_at_q30(const struct patch_shade *shade, unsigned axis, const int64_t away_px_q16[2])
{
    const int64_t by_x = shade->bend_q40[axis];
    const int64_t by_y = shade->bend_q40[axis + 1];
    const int64_t slope_q30 = shade->slope_q30[axis] + ((by_x * away_px_q16[0] + by_y * away_px_q16[1]) >> 26);
    return slope_q30 > LIMIT_Q30 ? LIMIT_Q30 : slope_q30 < -LIMIT_Q30 ? -LIMIT_Q30 : slope_q30;
}

/* What is printed in a shade between black and white is seen in one, and its slope lies between theirs as its
 * brightness does, whatever curve the camera has put between them. So a circle's contrast changes by the share that
 * it is of the full swing. */
void light_tilt(const struct patch_light *light, bool white, struct rim_view *view)
{
    const int64_t away_px_q16[2] = {(int64_t)view->ellipse.x_px_q16 - light->x_px_q16,
                                    (int64_t)view->ellipse.y_px_q16 - light->y_px_q16};
    int64_t swing_q30 = light->swing_q30;
    int64_t by_pixel_q30[2]; /* how the swing changes at the circle */
    for (unsigned axis = 0; axis < 2; axis++) {
        const int64_t black_q30 = slope_at_q30(&light->black, axis, away_px_q16);
        const int64_t white_q30 = slope_at_q30(&light->white, axis, away_px_q16);
        view->level_slope_q30[axis] = white ? black_q30 : white_q30;
        by_pixel_q30[axis] = white_q30 - black_q30;
        /* On the way there its slope is the mean of both ends'. */
        const int64_t first_q30 = light->white.slope_q30[axis] - light->black.slope_q30[axis];
        swing_q30 += ((first_q30 + by_pixel_q30[axis]) * away_px_q16[axis]) >> 17;
    }
    const bool known = light->swing_q30 >= SWING_MIN_Q30 && swing_q30 >= SWING_MIN_Q30;
    for (unsigned axis = 0; axis < 2; axis++) {
        view->contrast_slope_q30[axis] = known ? by_pixel_q30[axis] * view->contrast_q30 / swing_q30 : 0;
    }
}
