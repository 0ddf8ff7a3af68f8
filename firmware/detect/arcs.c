/* Cutting by the sign of the bend: at point i the contour turns from the chord that arrives over `step`
 * points to the chord that leaves over as many. */
#include "firmware/detect/arcs.h"

#include "common/fx/fx.h"
#include "common/fx/root.h"
#include "firmware/limits.h"

#define RADIUS_MIN_PX_Q16 163840 /* 2.5 px */

enum bend { BEND_NONE, BEND_LEFT, BEND_RIGHT, BEND_CORNER };

static enum bend bend_at(const struct contour *c, uint32_t i, uint32_t step)
{
    const uint32_t before = i >= step ? i - step : i + c->count - step;
    const uint32_t after = i + step < c->count ? i + step : i + step - c->count;
    /* Neighbours are at most 1 px apart in x and y (chains.h), 64 of them 2^14 in Q8; sums of products are below
     * 2^29. */
    const int32_t x = c->x_px_q16[i];
    const int32_t y = c->y_px_q16[i];
    const int32_t ax = (x - c->x_px_q16[before]) >> 8;
    const int32_t ay = (y - c->y_px_q16[before]) >> 8;
    const int32_t bx = (c->x_px_q16[after] - x) >> 8;
    const int32_t by = (c->y_px_q16[after] - y) >> 8;
    const int32_t cross = ax * by - ay * bx;
    const int32_t dot = ax * bx + ay * by;
    const int32_t size = cross < 0 ? -cross : cross;
    if (size >> 2 >= dot) {
        return BEND_CORNER; /* more than 76 degrees */
    }
    if (size < dot >> 4) {
        return BEND_NONE; /* less than 3.6 degrees */
    }
    return cross > 0 ? BEND_RIGHT : BEND_LEFT;
}

/* A run under construction. */
struct run_state {
    struct arcs_run run;
    enum bend       bend;
    uint32_t        straight; /* points at its end without a bend */
};

static uint32_t close_run(struct run_state *state, uint32_t shortest, struct arcs_run out[],
                          uint32_t count)
{
    const uint32_t length = state->run.count - state->straight;
    if (state->run.count > 0 && length >= shortest && count < ARCS_RUNS_MAX) {
        out[count].first = state->run.first;
        out[count].count = length;
        count++;
    }
    state->run.count = 0;
    state->straight = 0;
    return count;
}

/* Adds `points` points from i on, which bend like this, to the run, or ends it before or with them. */
static uint32_t extend_run(struct run_state *state, uint32_t i, uint32_t points, enum bend bend,
                           uint32_t step, uint32_t shortest, struct arcs_run out[], uint32_t count)
{
    const bool bends = bend == BEND_LEFT || bend == BEND_RIGHT;
    if (bends && state->run.count > 0 && state->bend != bend) {
        count = close_run(state, shortest, out, count);
    }
    if (bends && state->run.count == 0) {
        state->run.first = i;
        state->bend = bend;
    }
    state->run.count += points;
    state->straight = bends ? 0 : state->straight + points;
    if (bend == BEND_CORNER || state->straight > 2 * step) {
        count = close_run(state, shortest, out, count);
    }
    return count;
}

/* A corner or straight part of a closed contour, so that no arc is cut in two. */
static uint32_t find_start(const struct contour *contour, uint32_t step)
{
    for (uint32_t i = 0; i < contour->count; i++) {
        const enum bend bend = bend_at(contour, i, step);
        if (bend == BEND_NONE || bend == BEND_CORNER) {
            return i;
        }
    }
    return 0;
}

uint32_t arcs_split(const struct contour *contour, uint32_t step, uint32_t shortest,
                    struct arcs_run out[ARCS_RUNS_MAX])
{
    assert(step >= 1 && step <= 64);
    if (contour->count < 2 * step + 1 || contour->count < shortest) {
        return 0;
    }
    const uint32_t start = contour->closed ? find_start(contour, step) : step;
    const uint32_t visits = contour->closed ? contour->count : contour->count - 2 * step;
    /* Over long chords the bend changes slowly: every eighth of a step is enough. Between runs it is looked for in
     * leaps of a step, for it shows as far before and behind where it is; where one is found, the leap is taken
     * back. */
    const uint32_t stride = step >= 8 ? step / 8 : 1;
    const uint32_t leap = step / stride * stride - stride;
    uint32_t count = 0;
    uint32_t leapt = 0;
    uint32_t bent = 0; /* where one was found */
    struct run_state state = {.run = {0}, .bend = BEND_NONE, .straight = 0};
    for (uint32_t k = 0; k < visits; k += stride) {
        const uint32_t i = start + k < contour->count ? start + k : start + k - contour->count;
        const uint32_t points = visits - k < stride ? visits - k : stride;
        const enum bend bend = bend_at(contour, i, step);
        if (state.run.count == 0 && (bend == BEND_NONE || bend == BEND_CORNER)) {
            leapt = k >= bent ? leap : 0;
            k += leapt;
        } else if (leapt > 0) {
            bent = k;
            k -= leapt + stride;
            leapt = 0;
        } else {
            count = extend_run(&state, i, points, bend, step, shortest, out, count);
        }
    }
    return close_run(&state, shortest, out, count);
}

void arcs_init(struct arcs *arcs, struct arena *arena, unsigned width, unsigned height)
{
    arcs->size = limit_arcs(width, height);
    arcs->points_size = limit_arc_points(width, height);
    const size_t points = arcs->points_size + LIMIT_CONTOUR_POINTS;
    arcs->at = arena_take(arena, arcs->size, sizeof(struct arc));
    arcs->x_px_q16 = arena_take(arena, points, sizeof(int32_t));
    arcs->y_px_q16 = arena_take(arena, points, sizeof(int32_t));
}

void arcs_begin(struct arcs *arcs)
{
    arcs->count = 0;
    arcs->points = 0;
    arcs->truncated = false;
}

/* The circle through three points. With a = p1 - p0, b = p2 - p0 the centre is
 * p0 + (b_y |a|^2 - a_y |b|^2, a_x |b|^2 - b_x |a|^2) / (2 a x b). False for a radius beyond 512 px. */
static bool circle_through(const int32_t x[3], const int32_t y[3], struct arc *arc)
{
    /* Q6: offsets below 2^16 (1024 px), squares below 2^33, products below 2^49. */
    const int64_t ax = (x[1] - x[0]) >> 10;
    const int64_t ay = (y[1] - y[0]) >> 10;
    const int64_t bx = (x[2] - x[0]) >> 10;
    const int64_t by = (y[2] - y[0]) >> 10;
    const int64_t cross = ax * by - ay * bx;
    if (cross == 0) {
        return false;
    }
    const int64_t aa = ax * ax + ay * ay;
    const int64_t bb = bx * bx + by * by;
    const int64_t cx_q6 = (by * aa - ay * bb) / (2 * cross);
    const int64_t cy_q6 = (ax * bb - bx * aa) / (2 * cross);
    if (fx_abs_i64(cx_q6) > 512 << 6 || fx_abs_i64(cy_q6) > 512 << 6) {
        return false;
    }
    arc->x_px_q16 = fx_narrow_i32(x[0] + cx_q6 * 1024);
    arc->y_px_q16 = fx_narrow_i32(y[0] + cy_q6 * 1024);
    arc->radius_px_q16 = (int32_t)root_u64((uint64_t)(cx_q6 * cx_q6 + cy_q6 * cy_q6) << 20);
    /* Turning right (clockwise on the image) with the dark side on the left: bright inside. */
    arc->white = cross > 0;
    return true;
}

void arcs_keep(struct arcs *arcs, const int32_t x_px_q16[], const int32_t y_px_q16[],
               uint32_t count, uint16_t gradient_mean_q3)
{
    struct arc arc = {
        .first = arcs->points,
        .count = count,
        .gradient_mean_q3 = gradient_mean_q3,
    };
    const int32_t x[3] = {x_px_q16[0], x_px_q16[count / 2], x_px_q16[count - 1]};
    const int32_t y[3] = {y_px_q16[0], y_px_q16[count / 2], y_px_q16[count - 1]};
    /* The rounded corner of a triangle is an arc of 2 px radius at most; half a radian says nothing about
     * an ellipse (1.27 points a pixel of length). */
    if (!circle_through(x, y, &arc) || arc.radius_px_q16 < RADIUS_MIN_PX_Q16 ||
        (int64_t)count * 65536 < 3 * (int64_t)arc.radius_px_q16 / 2) {
        return;
    }
    if (arcs->count == arcs->size || arcs->points + count > arcs->points_size) {
        arcs->truncated = true;
        return;
    }
    for (uint32_t i = 0; i < count; i++) {
        arcs->x_px_q16[arcs->points + i] = x_px_q16[i];
        arcs->y_px_q16[arcs->points + i] = y_px_q16[i];
    }
    arcs->points += count;
    arcs->at[arcs->count++] = arc;
}

bool arcs_may_join(const struct arc *a, const struct arc *b)
{
    if (a->white != b->white || a->radius_px_q16 > 3 * (int64_t)b->radius_px_q16 ||
        b->radius_px_q16 > 3 * (int64_t)a->radius_px_q16) {
        return false;
    }
    const int64_t reach =
        a->radius_px_q16 > b->radius_px_q16 ? a->radius_px_q16 : b->radius_px_q16;
    return fx_abs_i64((int64_t)a->x_px_q16 - b->x_px_q16) <= reach &&
           fx_abs_i64((int64_t)a->y_px_q16 - b->y_px_q16) <= reach;
}
