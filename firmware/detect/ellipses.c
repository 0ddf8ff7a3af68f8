/* Fit, refit, judge; the order in which parts of a contour are tried. */
#include "firmware/detect/ellipses.h"

#include "common/fx/fx.h"
#include "firmware/detect/areafit.h"
#include "firmware/detect/directfit.h"
#include "firmware/detect/refit.h"
#include "firmware/limits.h"

/* The most points that a fit is given. */
#define POINTS_ENOUGH 24u

/* Chords, in points, over which arcs are looked for: 4 points follow circles of radius 3 px, 16 see the
 * bend of a radius of 100 px, for which a contour must have some length. */
static const uint32_t arc_steps[] = {16, 4};
#define ARC_CHORDS_MIN 8u

void ellipses_init(struct ellipses *ellipses, struct arena *arena, unsigned width, unsigned height)
{
    ellipses->size = limit_ellipses(width, height);
    ellipses->fits_max = limit_fits(width, height);
    ellipses->at = arena_take(arena, ellipses->size, sizeof(struct ellipses_item));
    arcs_init(&ellipses->arcs, arena, width, height);
}

void ellipses_begin(struct ellipses *ellipses)
{
    ellipses->count = 0;
    ellipses->truncated = false;
    ellipses->fits = 0;
    arcs_begin(&ellipses->arcs);
}

static unsigned count_sectors(uint16_t sectors)
{
    return (unsigned)__builtin_popcount(sectors);
}

/* The smaller eigenvalue of S, the squared minor axis, is at least t where S - t I is positive semidefinite; the
 * larger is what it leaves of the trace. */
static bool is_good(const struct ellipse *e, int64_t residual_px2_q12)
{
    if (residual_px2_q12 > ELLIPSES_RESIDUAL_MAX_PX2_Q12) {
        return false;
    }
    const int64_t trace_q12 = (int64_t)e->shape_xx_px2_q12 + e->shape_yy_px2_q12;
    int64_t least_q12 = trace_q12 / (ELLIPSES_AXIS_RATIO_MIN * ELLIPSES_AXIS_RATIO_MIN + 1);
    least_q12 = least_q12 > ELLIPSES_MINOR_MIN_PX2_Q12 ? least_q12 : ELLIPSES_MINOR_MIN_PX2_Q12;
    const int64_t share_q12 = residual_px2_q12 * (ELLIPSES_RESIDUAL_SHARE * ELLIPSES_RESIDUAL_SHARE);
    least_q12 = least_q12 > share_q12 ? least_q12 : share_q12;
    const int64_t xx_q12 = e->shape_xx_px2_q12 - least_q12;
    const int64_t yy_q12 = e->shape_yy_px2_q12 - least_q12;
    return xx_q12 >= 0 && yy_q12 >= 0 &&
           xx_q12 * yy_q12 >= (int64_t)e->shape_xy_px2_q12 * e->shape_xy_px2_q12;
}

/* Clockwise on the image around the centre: the sum of the triangles' signed areas. Offsets in Q4 are
 * below 2^20, 4096 products below 2^53. */
static bool turns_clockwise(const int32_t x_px_q16[], const int32_t y_px_q16[], uint32_t count,
                            const struct ellipse *ellipse)
{
    int64_t area = 0;
    int64_t px = (x_px_q16[0] - ellipse->x_px_q16) >> 12;
    int64_t py = (y_px_q16[0] - ellipse->y_px_q16) >> 12;
    for (uint32_t i = 1; i < count; i++) {
        const int64_t qx = (x_px_q16[i] - ellipse->x_px_q16) >> 12;
        const int64_t qy = (y_px_q16[i] - ellipse->y_px_q16) >> 12;
        area += px * qy - py * qx;
        px = qx;
        py = qy;
    }
    return area > 0;
}

/* Filtered points share their noise with four or five neighbours: of many, a few evenly chosen say nearly
 * all. */
struct thinned {
    int32_t  x_px_q16[POINTS_ENOUGH];
    int32_t  y_px_q16[POINTS_ENOUGH];
    uint32_t count;
};

static void thin_points(const int32_t x_px_q16[], const int32_t y_px_q16[], uint32_t count,
                        struct thinned *out)
{
    const uint32_t step = (count + POINTS_ENOUGH - 1) / POINTS_ENOUGH;
    out->count = 0;
    for (uint32_t i = step / 2; i < count; i += step) {
        out->x_px_q16[out->count] = x_px_q16[i];
        out->y_px_q16[out->count] = y_px_q16[i];
        out->count++;
    }
}

/* Books a fit. False, and reported, where there is no room for it or for what comes of it. */
static bool may_fit(struct ellipses *ellipses)
{
    if (ellipses->count == ellipses->size || ellipses->fits == ellipses->fits_max) {
        ellipses->truncated = true;
        return false;
    }
    ellipses->fits++;
    return true;
}

/* Adds the ellipse that a closed contour is, if it is a good one. True also where there is no room: it is of no use to
 * try parts of it. */
static bool try_whole(struct ellipses *ellipses, const struct contour *contour)
{
    struct areafit fit;
    if (contour->count < ELLIPSES_POINTS_MIN) {
        return false;
    }
    if (!may_fit(ellipses)) {
        return true;
    }
    if (!areafit_ellipse(contour->x_px_q16, contour->y_px_q16, contour->count, &fit) ||
        !is_good(&fit.ellipse, fit.residual_px2_q12)) {
        return false;
    }
    ellipses->at[ellipses->count++] = (struct ellipses_item){
        .ellipse = fit.ellipse,
        .gradient_mean_q3 = contour->gradient_mean_q3,
        .white = fit.clockwise,
    };
    return true;
}

/* The same for points of an arc, or of several whose colour is known. */
static bool try_points(struct ellipses *ellipses, const int32_t x_px_q16[],
                       const int32_t y_px_q16[], uint32_t count, uint16_t gradient_mean_q3,
                       bool white_known, bool white)
{
    struct ellipses_item item = {.gradient_mean_q3 = gradient_mean_q3};
    struct refit_quality quality;
    struct thinned thinned;
    if (count < ELLIPSES_POINTS_MIN) {
        return false;
    }
    if (!may_fit(ellipses)) {
        return true;
    }
    thin_points(x_px_q16, y_px_q16, count, &thinned);
    if (!directfit_ellipse(thinned.x_px_q16, thinned.y_px_q16, thinned.count, &item.ellipse) ||
        !refit_ellipse(thinned.x_px_q16, thinned.y_px_q16, thinned.count, &item.ellipse, &quality) ||
        count_sectors(quality.sectors) < ELLIPSES_SECTORS_MIN ||
        !is_good(&item.ellipse, ((int64_t)quality.residual_px_q16 * quality.residual_px_q16) >> 20)) {
        return false;
    }
    item.white = white_known ? white : turns_clockwise(x_px_q16, y_px_q16, count, &item.ellipse);
    ellipses->at[ellipses->count++] = item;
    return true;
}

/* Whether an arc turns by two right angles and so may reach ELLIPSES_SECTORS_MIN: half an ellipse turns by as much,
 * however it is tilted. What the chords at its ends take away, and noise, is left a third of that. */
static bool turns_enough(const int32_t x_px_q16[], const int32_t y_px_q16[], uint32_t count)
{
    const uint32_t step = count < 24 ? 2 : count / 12;
    const uint32_t end = count - 1;
    const uint32_t middle = count / 2;
    /* Q8: below 2^22. */
    const int64_t ax = (x_px_q16[step] - x_px_q16[0]) >> 8;
    const int64_t ay = (y_px_q16[step] - y_px_q16[0]) >> 8;
    const int64_t bx = (x_px_q16[end] - x_px_q16[end - step]) >> 8;
    const int64_t by = (y_px_q16[end] - y_px_q16[end - step]) >> 8;
    const int64_t to_x = (x_px_q16[middle] - x_px_q16[0]) >> 8;
    const int64_t to_y = (y_px_q16[middle] - y_px_q16[0]) >> 8;
    const int64_t on_x = (x_px_q16[end] - x_px_q16[middle]) >> 8;
    const int64_t on_y = (y_px_q16[end] - y_px_q16[middle]) >> 8;
    const bool right = to_x * on_y - to_y * on_x > 0;
    const int64_t cross = right ? ax * by - ay * bx : ay * bx - ax * by;
    return cross < 0 || 2 * (ax * bx + ay * by) < -cross; /* 117 degrees */
}

static void reverse(int32_t *values, uint32_t first, uint32_t last)
{
    while (first < last) {
        const int32_t swap = values[first];
        values[first++] = values[last];
        values[last--] = swap;
    }
}

/* Rotates a closed contour so that it starts at point `first`: its arcs are then contiguous. */
static void rotate_contour(struct contour *contour, uint32_t first)
{
    if (first == 0) {
        return;
    }
    int32_t *axes[2] = {contour->x_px_q16, contour->y_px_q16};
    for (unsigned i = 0; i < 2; i++) {
        reverse(axes[i], 0, first - 1);
        reverse(axes[i], first, contour->count - 1);
        reverse(axes[i], 0, contour->count - 1);
    }
}

static void add_arcs(struct ellipses *ellipses, struct contour *contour)
{
    struct arcs_run runs[ARCS_RUNS_MAX];
    for (unsigned s = 0; s < sizeof arc_steps / sizeof arc_steps[0]; s++) {
        const uint32_t step = arc_steps[s];
        if (step != arc_steps[1] && contour->count < ARC_CHORDS_MIN * step) {
            continue;
        }
        const uint32_t count = arcs_split(contour, step, ELLIPSES_POINTS_MIN, runs);
        bool found = false;
        for (uint32_t i = 0; i < count; i++) {
            /* After each rotation the other runs' places move with the points. */
            const uint32_t first = runs[i].first;
            if (first + runs[i].count > contour->count) {
                rotate_contour(contour, first);
                for (uint32_t j = i; j < count; j++) {
                    runs[j].first = (runs[j].first + contour->count - first) % contour->count;
                }
            }
            const int32_t *x = contour->x_px_q16 + runs[i].first;
            const int32_t *y = contour->y_px_q16 + runs[i].first;
            if (turns_enough(x, y, runs[i].count) &&
                try_points(ellipses, x, y, runs[i].count, contour->gradient_mean_q3, false, false)) {
                found = true;
            } else if (step == arc_steps[1]) {
                arcs_keep(&ellipses->arcs, x, y, runs[i].count, contour->gradient_mean_q3);
            }
        }
        if (found) {
            return;
        }
    }
}

void ellipses_add(struct ellipses *ellipses, struct contour *contour)
{
    if (!contour->closed || !try_whole(ellipses, contour)) {
        add_arcs(ellipses, contour);
    }
}

/* Tries arc `i` together with every later one that may belong to it; points are gathered behind the
 * store's own, where the room for one contour is kept. */
static void merge_with_later(struct ellipses *ellipses, uint32_t i)
{
    struct arcs *arcs = &ellipses->arcs;
    struct arc *first = &arcs->at[i];
    int32_t *x = arcs->x_px_q16 + arcs->points_size;
    int32_t *y = arcs->y_px_q16 + arcs->points_size;
    /* As far as three times its radius reaches (arcs_may_join): most others lie above or below. */
    const int64_t top = first->y_px_q16 - 3 * (int64_t)first->radius_px_q16;
    const int64_t bottom = first->y_px_q16 + 3 * (int64_t)first->radius_px_q16;
    for (uint32_t j = i + 1; j < arcs->count && !first->used; j++) {
        struct arc *second = &arcs->at[j];
        if (second->y_px_q16 < top || second->y_px_q16 > bottom) {
            continue;
        }
        if (second->used || first->count + second->count > LIMIT_CONTOUR_POINTS ||
            !arcs_may_join(first, second)) {
            continue;
        }
        uint32_t count = 0;
        const struct arc *parts[2] = {first, second};
        for (unsigned part = 0; part < 2; part++) {
            for (uint32_t k = 0; k < parts[part]->count; k++) {
                x[count] = arcs->x_px_q16[parts[part]->first + k];
                y[count] = arcs->y_px_q16[parts[part]->first + k];
                count++;
            }
        }
        if (try_points(ellipses, x, y, count, first->gradient_mean_q3, true, first->white)) {
            first->used = true;
            second->used = true;
        }
    }
}

void ellipses_end(struct ellipses *ellipses)
{
    for (uint32_t i = 0; i < ellipses->arcs.count; i++) {
        if (!ellipses->arcs.at[i].used) {
            merge_with_later(ellipses, i);
        }
    }
}

void ellipses_double(struct ellipses *ellipses)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < ellipses->count; i++) {
        struct ellipses_item *item = &ellipses->at[i];
        struct ellipse *e = &item->ellipse;
        if (e->shape_xx_px2_q12 > ELLIPSE_SHAPE_MAX_PX2_Q12 / 4 ||
            e->shape_yy_px2_q12 > ELLIPSE_SHAPE_MAX_PX2_Q12 / 4) {
            continue;
        }
        /* Pixel 0 of the small frame has its centre between pixels 0 and 1 of the large one. */
        e->x_px_q16 = 2 * e->x_px_q16 + 32768;
        e->y_px_q16 = 2 * e->y_px_q16 + 32768;
        e->shape_xx_px2_q12 *= 4;
        e->shape_xy_px2_q12 *= 4;
        e->shape_yy_px2_q12 *= 4;
        item->gradient_mean_q3 /= 2;
        ellipses->at[kept++] = *item;
    }
    ellipses->count = kept;
}
