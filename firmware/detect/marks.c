/* See marks.h for the rules. */
#include "firmware/detect/marks.h"

#include "common/fx/fx.h"
#include "common/fx/root.h"
#include "firmware/limits.h"

#define NEIGHBOURS_MAX 64u
/* Prior weight of the frame's common noise factor, in degrees of freedom: a single small circle has five
 * or ten of its own, so its residual alone would say little. */
#define PRIOR_FREEDOM_Q8 (16u << 8)
#define FITTED_Q8        (5u << 8)
/* Relative sizes are put into bins of 1/16 from 0 to 8. */
#define BINS             128u

void marks_init(struct marks *marks, struct arena *arena, unsigned width, unsigned height)
{
    marks->size = limit_ellipses(width, height);
    marks->columns = (width + MARKS_CELL_PX - 1) / MARKS_CELL_PX;
    marks->rows = (height + MARKS_CELL_PX - 1) / MARKS_CELL_PX;
    marks->at = arena_take(arena, marks->size, sizeof(struct mark));
    marks->relative_q8 = arena_take(arena, marks->size, sizeof(uint16_t));
    marks->cells = arena_take(arena, (size_t)marks->columns * marks->rows, sizeof(uint32_t));
}

static unsigned cell_of(int64_t px_q16, unsigned cells)
{
    const int64_t cell = px_q16 / ((int64_t)MARKS_CELL_PX << 16);
    if (px_q16 < 0) {
        return 0;
    }
    return cell >= (int64_t)cells ? cells - 1 : (unsigned)cell;
}

static void fill_cells(struct marks *marks)
{
    for (size_t i = 0; i < (size_t)marks->columns * marks->rows; i++) {
        marks->cells[i] = MARKS_NONE;
    }
    for (uint32_t i = marks->count; i-- > 0;) {
        struct mark *mark = &marks->at[i];
        uint32_t *cell = &marks->cells[cell_of(mark->ellipse.y_px_q16, marks->rows) *
                                           (size_t)marks->columns +
                                       cell_of(mark->ellipse.x_px_q16, marks->columns)];
        mark->next = *cell;
        *cell = i;
    }
}

uint32_t marks_near(const struct marks *marks, int32_t x_px_q16, int32_t y_px_q16,
                    uint32_t reach_px_q16, uint32_t out[], uint32_t size)
{
    const int64_t reach = reach_px_q16;
    const unsigned left = cell_of(x_px_q16 - reach, marks->columns);
    const unsigned right = cell_of(x_px_q16 + reach, marks->columns);
    const unsigned top = cell_of(y_px_q16 - reach, marks->rows);
    const unsigned bottom = cell_of(y_px_q16 + reach, marks->rows);
    uint32_t count = 0;
    for (unsigned row = top; row <= bottom; row++) {
        for (unsigned column = left; column <= right; column++) {
            uint32_t i = marks->cells[row * (size_t)marks->columns + column];
            for (; i != MARKS_NONE; i = marks->at[i].next) {
                const struct ellipse *e = &marks->at[i].ellipse;
                if (fx_abs_i64((int64_t)e->x_px_q16 - x_px_q16) <= reach &&
                    fx_abs_i64((int64_t)e->y_px_q16 - y_px_q16) <= reach && count < size) {
                    out[count++] = i;
                }
            }
        }
    }
    return count;
}

/* (residual * gradient)^2 of the points of one ellipse, px * grey_q4 / px, Q12: residuals up to 0.4 px
 * and gradients up to 2^15 stay below 2^42. */
static uint64_t noise_factor_q12(const struct ellipses_item *item)
{
    const uint64_t product_q9 =
        ((uint64_t)item->quality.residual_px_q16 * item->gradient_mean_q3) >> 10;
    return (product_q9 * product_q9) >> 6;
}

/* The frame's common factor: the mean over its ellipses, then over those below four times that mean, for
 * a few bad fits must not speak for all. */
static uint64_t common_factor_q12(const struct ellipses *ellipses, uint32_t correlation_q8)
{
    uint64_t limit = UINT64_MAX;
    uint64_t mean = 0;
    for (unsigned pass = 0; pass < 2; pass++) {
        uint64_t sum = 0;
        uint64_t weight_q8 = 0;
        for (uint32_t i = 0; i < ellipses->count; i++) {
            const struct ellipses_item *item = &ellipses->at[i];
            const uint64_t factor = noise_factor_q12(item);
            const uint64_t free_q8 = ((uint64_t)item->points << 16) / correlation_q8;
            if (free_q8 > FITTED_Q8 + 256 && factor <= limit) {
                /* The fit takes five degrees of freedom out of the squares. */
                sum += (factor * (free_q8 >> 4)) >> 4;
                weight_q8 += free_q8 - FITTED_Q8;
            }
        }
        if (weight_q8 == 0) {
            return mean;
        }
        mean = sum / weight_q8 * 256 + (sum % weight_q8) * 256 / weight_q8;
        limit = 4 * mean;
    }
    return mean;
}

static uint32_t centre_sigma_px_q20(const struct ellipses_item *item, uint64_t common_q12,
                                    uint32_t correlation_q8)
{
    const uint64_t gradient_q3 = item->gradient_mean_q3 > 0 ? item->gradient_mean_q3 : 1;
    const uint64_t free_q8 = ((uint64_t)item->points << 16) / correlation_q8;
    const uint64_t left_q8 = free_q8 > FITTED_Q8 ? free_q8 - FITTED_Q8 : 0;
    const uint64_t own_q12 = noise_factor_q12(item);
    const uint64_t factor_q12 =
        (common_q12 * PRIOR_FREEDOM_Q8 + own_q12 * free_q8) / (PRIOR_FREEDOM_Q8 + left_q8);
    /* One point: root(factor) / gradient. Q12 -> Q6 root; over Q3 -> Q3; with 17 more bits Q20. */
    const uint64_t point_px_q20 =
        ((uint64_t)root_u64(factor_q12 << 8) << 13) / gradient_q3;
    const uint64_t root_correlation_q8 = root_u64((uint64_t)correlation_q8 << 8);
    const uint64_t sigma =
        (((point_px_q20 * item->quality.gain_q16) >> 16) * root_correlation_q8) >> 8;
    return (uint32_t)(sigma > UINT32_MAX ? UINT32_MAX : sigma);
}

/* Whether the second of two marks around one point is the circle's double, not the circle. */
static bool is_double(const struct mark *circle, const struct mark *other)
{
    const uint32_t large = circle->size_px_q16 > other->size_px_q16 ? circle->size_px_q16
                                                                    : other->size_px_q16;
    const int64_t near = large / 3;
    if (fx_abs_i64((int64_t)circle->ellipse.x_px_q16 - other->ellipse.x_px_q16) > near ||
        fx_abs_i64((int64_t)circle->ellipse.y_px_q16 - other->ellipse.y_px_q16) > near) {
        return false;
    }
    if (circle->white == other->white) {
        return other->size_px_q16 < circle->size_px_q16;
    }
    return other->size_px_q16 > circle->size_px_q16;
}

static void drop_doubles(struct marks *marks)
{
    uint32_t near[NEIGHBOURS_MAX];
    for (uint32_t i = 0; i < marks->count; i++) {
        struct mark *mark = &marks->at[i];
        const uint32_t count =
            marks_near(marks, mark->ellipse.x_px_q16, mark->ellipse.y_px_q16, mark->size_px_q16,
                       near, NEIGHBOURS_MAX);
        bool dropped = false;
        for (uint32_t k = 0; k < count && !dropped; k++) {
            const struct mark *other = &marks->at[near[k]];
            /* Of two of the same size and colour the first stays. */
            dropped = near[k] != i && (is_double(other, mark) ||
                                       (near[k] < i && other->white == mark->white &&
                                        other->size_px_q16 == mark->size_px_q16 &&
                                        other->ellipse.x_px_q16 == mark->ellipse.x_px_q16));
        }
        marks->relative_q8[i] = dropped ? 1 : 0;
    }
    uint32_t kept = 0;
    for (uint32_t i = 0; i < marks->count; i++) {
        if (marks->relative_q8[i] == 0) {
            marks->at[kept++] = marks->at[i];
        }
    }
    marks->count = kept;
    fill_cells(marks);
}

/* Size over the median size of the marks within six times the size, itself included: for a circle of
 * either kind most of those are small. */
static uint16_t relative_size_q8(const struct marks *marks, uint32_t index)
{
    const struct mark *mark = &marks->at[index];
    uint32_t near[NEIGHBOURS_MAX];
    uint32_t sizes[NEIGHBOURS_MAX];
    const uint32_t count =
        marks_near(marks, mark->ellipse.x_px_q16, mark->ellipse.y_px_q16,
                   fx_saturate_u16(mark->size_px_q16 >> 10) * (6u << 10), near, NEIGHBOURS_MAX);
    for (uint32_t i = 0; i < count; i++) { /* insertion sort */
        const uint32_t size = marks->at[near[i]].size_px_q16;
        uint32_t k = i;
        for (; k > 0 && sizes[k - 1] > size; k--) {
            sizes[k] = sizes[k - 1];
        }
        sizes[k] = size;
    }
    const uint32_t median = count > 0 ? sizes[(count - 1) / 2] : mark->size_px_q16;
    return fx_saturate_u16((int64_t)(((uint64_t)mark->size_px_q16 << 8) / (median > 0 ? median : 1)));
}

/* Otsu: the threshold that maximises w0 w1 (m1 - m0)^2. Biased: times 1 / (1 + ((m1 / m0 - ratio) /
 * (ratio / 4))^2), so that of several valleys the one between classes of the known ratio wins. Without a
 * second class, the geometric mean of the two expected sizes. */
static uint32_t biased_otsu_q8(const struct marks *marks, uint32_t ratio_q8)
{
    uint32_t bins[BINS] = {0};
    uint64_t total = 0;
    for (uint32_t i = 0; i < marks->count; i++) {
        const uint32_t bin = marks->relative_q8[i] >> 4;
        bins[bin < BINS ? bin : BINS - 1]++;
        total += bin < BINS ? bin : BINS - 1;
    }
    uint32_t best_q8 = root_u64((uint64_t)ratio_q8 << 8);
    uint64_t best = 0;
    uint64_t below = 0;
    uint64_t below_sum = 0;
    for (uint32_t t = 1; t < BINS; t++) {
        below += bins[t - 1];
        below_sum += (uint64_t)bins[t - 1] * (t - 1);
        const uint64_t above = marks->count - below;
        if (below == 0 || above == 0) {
            continue;
        }
        /* Class means as relative sizes (bin centres), Q8. */
        const int64_t m0_q8 = (int64_t)(below_sum * 16 / below) + 8;
        const int64_t m1_q8 = (int64_t)((total - below_sum) * 16 / above) + 8;
        const int64_t off_q8 = (m1_q8 * 256 / m0_q8 - (int64_t)ratio_q8) * 1024 / (int64_t)ratio_q8;
        const uint64_t spread = (uint64_t)((m1_q8 - m0_q8) * (m1_q8 - m0_q8));
        const uint64_t score =
            below * above * spread / (uint64_t)(65536 + off_q8 * off_q8);
        if (score > best) {
            best = score;
            /* The middle of an empty valley, not its edge. */
            best_q8 = (uint32_t)((m0_q8 + m1_q8) / 2);
        }
    }
    return best_q8;
}

void marks_classify(const struct ellipses *ellipses, uint32_t kernel_sigma_px_q16, uint32_t ratio_q8,
                    struct marks *out)
{
    const uint32_t correlation_q8 =
        (uint32_t)((kernel_sigma_px_q16 * (uint64_t)FX_Q(4.51, 8)) >> 16);
    const uint64_t common_q12 = common_factor_q12(ellipses, correlation_q8);
    out->count = ellipses->count;
    assert(out->count <= out->size);
    for (uint32_t i = 0; i < ellipses->count; i++) {
        const struct ellipses_item *item = &ellipses->at[i];
        out->at[i] = (struct mark){
            .ellipse = item->ellipse,
            .size_px_q16 = ellipse_size_px_q16(&item->ellipse),
            .sigma_px_q20 = centre_sigma_px_q20(item, common_q12, correlation_q8),
            .gradient_q3 = item->gradient_mean_q3,
            .white = item->white,
        };
    }
    fill_cells(out);
    drop_doubles(out);
    for (uint32_t i = 0; i < out->count; i++) {
        out->relative_q8[i] = relative_size_q8(out, i);
    }
    const uint32_t threshold_q8 = biased_otsu_q8(out, ratio_q8);
    for (uint32_t i = 0; i < out->count; i++) {
        out->at[i].large = out->relative_q8[i] > threshold_q8;
    }
}
