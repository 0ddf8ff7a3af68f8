/* See marks.h for the rules. */
#include "firmware/detect/marks.h"

#include "common/fx/fx.h"
#include "common/fx/root.h"
#include "firmware/limits.h"

#define NEIGHBOURS_MAX 64u
/* Relative sizes are put into bins of 1/16 from 0 to 8. */
#define BINS           128u

void marks_init(struct marks *marks, struct arena *arena, unsigned width, unsigned height)
{
    marks->size = limit_ellipses(width, height);
    marks->columns = (width + MARKS_CELL_PX - 1) / MARKS_CELL_PX;
    marks->rows = (height + MARKS_CELL_PX - 1) / MARKS_CELL_PX;
    marks->at = arena_take(arena, marks->size, sizeof(struct mark));
    marks->relative_q8 = arena_take(arena, marks->size, sizeof(uint16_t));
    marks->by_cell = arena_take(arena, marks->size, sizeof(uint32_t));
    marks->cells = arena_take(arena, (size_t)marks->columns * marks->rows + 1, sizeof(uint32_t));
}

static unsigned cell_of(int64_t px_q16, unsigned cells)
{
    if (px_q16 < 0) {
        return 0;
    }
    const uint64_t cell = (uint64_t)px_q16 / (MARKS_CELL_PX << 16);
    return cell >= cells ? cells - 1 : (unsigned)cell;
}

static size_t cell_at(const struct marks *marks, const struct mark *mark)
{
    return cell_of(mark->ellipse.y_px_q16, marks->rows) * (size_t)marks->columns +
           cell_of(mark->ellipse.x_px_q16, marks->columns);
}

/* Counts each cell's marks, adds up where they end, and fills from there backwards to where they begin. */
static void fill_cells(struct marks *marks)
{
    const size_t cells = (size_t)marks->columns * marks->rows;
    for (size_t i = 0; i < cells; i++) {
        marks->cells[i] = 0;
    }
    for (uint32_t i = 0; i < marks->count; i++) {
        marks->cells[cell_at(marks, &marks->at[i])]++;
    }
    uint32_t end = 0;
    for (size_t i = 0; i < cells; i++) {
        end += marks->cells[i];
        marks->cells[i] = end;
    }
    marks->cells[cells] = end;
    for (uint32_t i = marks->count; i-- > 0;) {
        marks->by_cell[--marks->cells[cell_at(marks, &marks->at[i])]] = i;
    }
}

uint32_t marks_near(const struct marks *marks, int32_t x_px_q16, int32_t y_px_q16,
                    uint32_t reach_px_q16, uint32_t out[], uint32_t size)
{
    const int64_t from_x = (int64_t)x_px_q16 - reach_px_q16;
    const int64_t from_y = (int64_t)y_px_q16 - reach_px_q16;
    const uint64_t width = 2 * (uint64_t)reach_px_q16;
    const unsigned left = cell_of(from_x, marks->columns);
    const unsigned right = cell_of(from_x + (int64_t)width, marks->columns);
    const unsigned top = cell_of(from_y, marks->rows);
    const unsigned bottom = cell_of(from_y + (int64_t)width, marks->rows);
    const struct mark *at = marks->at;
    uint32_t count = 0;
    for (unsigned row = top; row <= bottom; row++) {
        const uint32_t *cells = marks->cells + row * (size_t)marks->columns;
        for (uint32_t k = cells[left]; k < cells[right + 1]; k++) {
            const struct ellipse *e = &at[marks->by_cell[k]].ellipse;
            /* What lies before the square wraps: too large then. */
            if ((uint64_t)(e->x_px_q16 - from_x) <= width && (uint64_t)(e->y_px_q16 - from_y) <= width &&
                count < size) {
                out[count++] = marks->by_cell[k];
            }
        }
    }
    return count;
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

void marks_classify(const struct ellipses *ellipses, uint32_t ratio_q8, struct marks *out)
{
    out->count = ellipses->count;
    assert(out->count <= out->size);
    for (uint32_t i = 0; i < ellipses->count; i++) {
        const struct ellipses_item *item = &ellipses->at[i];
        out->at[i] = (struct mark){
            .ellipse = item->ellipse,
            .size_px_q16 = ellipse_size_px_q16(&item->ellipse),
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
