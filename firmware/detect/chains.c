/* One sweep a cell row over three sorted lists: the points on the row above, on this row, and in the
 * gap between them. Cells without a point are never visited. */
#include "firmware/detect/chains.h"

#include "common/fx/fx.h"
#include "firmware/limits.h"

/* Open contours have an end on the last row or in the cell at hand; finished ones wait until the row
 * is done. Neither can be more than the points of two rows and the gap. */
static uint32_t chains_limit(unsigned width)
{
    return 4u * width + 8u;
}

void chains_init(struct chains *chains, struct arena *arena, unsigned width, unsigned height)
{
    chains->points_size = limit_points(width, height);
    chains->chains_size = chains_limit(width);
    chains->points = arena_take(arena, chains->points_size, sizeof(struct chain_point));
    chains->chains = arena_take(arena, chains->chains_size, sizeof(struct chain));
    chains->finished = arena_take(arena, chains->chains_size, sizeof(uint32_t));
    chains->top = arena_take(arena, width, sizeof(struct chain_end));
    chains->bottom = arena_take(arena, width, sizeof(struct chain_end));
}

void chains_begin(struct chains *chains)
{
    for (uint32_t i = 0; i < chains->points_size; i++) {
        chains->points[i].next = i + 1 < chains->points_size ? i + 1 : CHAINS_NONE;
    }
    for (uint32_t i = 0; i < chains->chains_size; i++) {
        chains->chains[i].head = i + 1 < chains->chains_size ? i + 1 : CHAINS_NONE;
    }
    chains->points_free = 0;
    chains->chains_free = 0;
    chains->finished_count = 0;
    chains->finished_taken = 0;
    chains->top_count = 0;
    chains->points_used = 0;
    chains->points_used_max = 0;
    chains->truncated = false;
}

static void free_point(struct chains *chains, uint32_t point)
{
    chains->points[point].next = chains->points_free;
    chains->points_free = point;
    assert(chains->points_used > 0);
    chains->points_used--;
}

/* Makes a contour of one point, open on one side. CHAINS_NONE when there is no room. */
static uint32_t add_point(struct chains *chains, const struct edge *edge)
{
    const uint32_t point = chains->points_free;
    const uint32_t index = chains->chains_free;
    if (point == CHAINS_NONE || index == CHAINS_NONE) {
        chains->truncated = true;
        return CHAINS_NONE;
    }
    chains->points_free = chains->points[point].next;
    chains->chains_free = chains->chains[index].head;
    chains->points_used++;
    if (chains->points_used > chains->points_used_max) {
        chains->points_used_max = chains->points_used;
    }
    chains->points[point] = (struct chain_point){
        .x_px_q16 = edge->x_px_q16,
        .y_px_q16 = edge->y_px_q16,
        .next = CHAINS_NONE,
        .chain = index,
    };
    chains->chains[index] = (struct chain){
        .head = point,
        .tail = point,
        .count = 1,
        .open = 1,
        .gradient_sum_q3 = edge->gradient_q3,
    };
    return point;
}

/* Keeps only the two ends of a contour. */
static void drop_inside(struct chains *chains, struct chain *chain)
{
    if (chain->head == chain->tail) {
        return;
    }
    uint32_t point = chains->points[chain->head].next;
    while (point != chain->tail) {
        const uint32_t next = chains->points[point].next;
        free_point(chains, point);
        point = next;
    }
    chains->points[chain->head].next = chain->tail;
}

/* One of the contour's open points has seen both its cells. */
static void settle_end(struct chains *chains, uint32_t index)
{
    struct chain *chain = &chains->chains[index];
    assert(chain->open > 0);
    chain->open--;
    if (chain->open == 0) {
        assert(chains->finished_count < chains->chains_size);
        chains->finished[chains->finished_count++] = index;
    }
}

/* The four sides of one cell: top and left were met before, bottom and right are new. */
enum side { SIDE_TOP, SIDE_LEFT, SIDE_BOTTOM, SIDE_RIGHT, SIDES };

struct cell {
    struct chain_end at[SIDES];
    uint32_t         owner[SIDES]; /* the contour each point belongs to, kept true while joining */
};

/* The contour that ends at side `from` goes on with the one that starts at side `to`. */
static void link_sides(struct chains *chains, struct cell *cell, unsigned from, unsigned to)
{
    const uint32_t before = cell->owner[from];
    const uint32_t after = cell->owner[to];
    struct chain *first = &chains->chains[before];
    struct chain *second = &chains->chains[after];
    assert(first->tail == cell->at[from].point && second->head == cell->at[to].point);
    if (before == after) {
        first->closed = true;
        return;
    }
    const bool overlong = first->overlong || second->overlong ||
                          first->count + second->count > LIMIT_CONTOUR_POINTS;
    chains->points[first->tail].next = second->head;
    first->tail = second->tail;
    first->count += second->count;
    first->open += second->open;
    first->gradient_sum_q3 += second->gradient_sum_q3;
    first->overlong = overlong;
    chains->points[first->tail].chain = before;
    if (overlong) {
        drop_inside(chains, first);
    }
    second->head = chains->chains_free;
    chains->chains_free = after;
    for (unsigned i = 0; i < SIDES; i++) {
        if (cell->owner[i] == after) {
            cell->owner[i] = before;
        }
    }
}

static int64_t distance_q32(const struct chains *chains, const struct cell *cell, unsigned a,
                            unsigned b)
{
    const struct chain_point *from = &chains->points[cell->at[a].point];
    const struct chain_point *to = &chains->points[cell->at[b].point];
    const int64_t dx = (int64_t)from->x_px_q16 - to->x_px_q16;
    const int64_t dy = (int64_t)from->y_px_q16 - to->y_px_q16;
    return dx * dx + dy * dy;
}

/* Joins the points of one cell, entrances to exits; the nearest where there is a choice (a saddle, or a
 * cell with a crossing that did not count). */
static void link_cell(struct chains *chains, struct cell *cell, const unsigned entries[],
                      unsigned entry_count, const unsigned exits[], unsigned exit_count)
{
    if (entry_count == 2 && exit_count == 2) {
        const int64_t straight = distance_q32(chains, cell, entries[0], exits[0]) +
                                 distance_q32(chains, cell, entries[1], exits[1]);
        const int64_t crossed = distance_q32(chains, cell, entries[0], exits[1]) +
                                distance_q32(chains, cell, entries[1], exits[0]);
        const unsigned swap = straight <= crossed ? 0 : 1;
        link_sides(chains, cell, entries[0], exits[swap]);
        link_sides(chains, cell, entries[1], exits[1 - swap]);
        return;
    }
    unsigned best_entry = SIDES;
    unsigned best_exit = SIDES;
    int64_t best = INT64_MAX;
    for (unsigned i = 0; i < entry_count; i++) {
        for (unsigned j = 0; j < exit_count; j++) {
            const int64_t distance = distance_q32(chains, cell, entries[i], exits[j]);
            if (distance < best) {
                best = distance;
                best_entry = entries[i];
                best_exit = exits[j];
            }
        }
    }
    if (best_entry != SIDES) {
        link_sides(chains, cell, best_entry, best_exit);
    }
}

/* Links what meets in the cell; its top and left point have then seen both their cells. */
static void visit_cell(struct chains *chains, struct cell *cell)
{
    unsigned entries[SIDES];
    unsigned exits[SIDES];
    unsigned entry_count = 0;
    unsigned exit_count = 0;
    for (unsigned i = 0; i < SIDES; i++) {
        cell->owner[i] = CHAINS_NONE;
        if (cell->at[i].point == CHAINS_NONE) {
            continue;
        }
        cell->owner[i] = chains->points[cell->at[i].point].chain;
        /* Downwards through the top and rightwards through the left lead in; the other two lead out. */
        if (cell->at[i].forward == (i == SIDE_TOP || i == SIDE_LEFT)) {
            entries[entry_count++] = i;
        } else {
            exits[exit_count++] = i;
        }
    }
    link_cell(chains, cell, entries, entry_count, exits, exit_count);
    for (unsigned i = SIDE_TOP; i <= SIDE_LEFT; i++) {
        if (cell->at[i].point != CHAINS_NONE) {
            settle_end(chains, cell->owner[i]);
        }
    }
}

static struct chain_end make_end(struct chains *chains, const struct edge *edge)
{
    return (struct chain_end){
        .point = add_point(chains, edge),
        .column = edge->column,
        .forward = edge->forward,
    };
}

/* The most frequent cell: one point from before and one new, and the contour passes from one to the other.
 * Lengthens the contour by the new point, which makes *end of it; what add_point, link_sides and settle_end
 * would do by way of a contour of its own. False, with nothing done, where the cell is not like that. */
static bool pass_through(struct chains *chains, const struct chain_end *old,
                         const struct edge *edge, struct chain_end *end)
{
    /* Both lie on sides of unlike kinds, so equal directions make one an entrance and one an exit. */
    if (old->forward != edge->forward || chains->points_free == CHAINS_NONE) {
        return false;
    }
    const uint32_t index = chains->points[old->point].chain;
    struct chain *chain = &chains->chains[index];
    if (chain->overlong || chain->count >= LIMIT_CONTOUR_POINTS) {
        return false;
    }
    const uint32_t point = chains->points_free;
    struct chain_point *added = &chains->points[point];
    chains->points_free = added->next;
    chains->points_used++;
    if (chains->points_used > chains->points_used_max) {
        chains->points_used_max = chains->points_used;
    }
    added->x_px_q16 = edge->x_px_q16;
    added->y_px_q16 = edge->y_px_q16;
    added->chain = index;
    if (edge->forward) {
        assert(chain->tail == old->point);
        added->next = CHAINS_NONE;
        chains->points[chain->tail].next = point;
        chain->tail = point;
    } else {
        assert(chain->head == old->point);
        added->next = chain->head;
        chain->head = point;
    }
    chain->count++;
    chain->gradient_sum_q3 += edge->gradient_q3;
    end->point = point;
    end->column = edge->column;
    end->forward = edge->forward;
    return true;
}

static const struct chain_end no_end = {.point = CHAINS_NONE};

/* How far the sweep over one row of cells has come: indices into the lists, and the left side's point. */
struct sweep {
    struct chain_end left;
    uint32_t         top;
    uint32_t         across;
    uint32_t         down;
};

/* The next cell with anything in it, or UINT16_MAX. A point down column c is the right side of cell c - 1
 * and then the left side of cell c. */
static inline unsigned next_column(const struct chains *chains, const struct edge_row *edges,
                                   const struct sweep *at)
{
    unsigned column = UINT16_MAX;
    if (at->left.point != CHAINS_NONE) {
        column = at->left.column;
    }
    if (at->top < chains->top_count && chains->top[at->top].column < column) {
        column = chains->top[at->top].column;
    }
    if (at->across < edges->across_count && edges->across[at->across].column < column) {
        column = edges->across[at->across].column;
    }
    if (at->down < edges->down_count) {
        const unsigned down = edges->down[at->down].column;
        const unsigned first_cell = down == 0 ? 0 : down - 1;
        column = first_cell < column ? first_cell : column;
    }
    return column;
}

/* Handles the cell where one contour passes through; false, with nothing done, where it is another kind. */
static inline bool sweep_passing(struct chains *chains, const struct edge_row *edges,
                                 struct sweep *at, unsigned column)
{
    const bool left = at->left.point != CHAINS_NONE && at->left.column == column;
    const bool top = at->top < chains->top_count && chains->top[at->top].column == column;
    const bool bottom =
        at->across < edges->across_count && edges->across[at->across].column == column;
    const bool down = at->down < edges->down_count;
    const bool right = down && edges->down[at->down].column == column + 1;
    if (left == top || right == bottom || (down && edges->down[at->down].column == column)) {
        return false;
    }
    const struct chain_end *old = left ? &at->left : &chains->top[at->top];
    const struct edge *edge = right ? &edges->down[at->down] : &edges->across[at->across];
    struct chain_end end;
    if (old->point == CHAINS_NONE || !pass_through(chains, old, edge, &end)) {
        return false;
    }
    at->top += top ? 1 : 0;
    if (right) {
        at->down++;
        at->left = end;
    } else {
        chains->bottom[at->across++] = end;
        at->left = no_end;
    }
    return true;
}

static void sweep_any(struct chains *chains, const struct edge_row *edges, struct sweep *at,
                      unsigned column)
{
    struct cell cell = {.at = {no_end, no_end, no_end, no_end}};
    if (at->left.point != CHAINS_NONE && at->left.column == column) {
        cell.at[SIDE_LEFT] = at->left;
    } else if (at->down < edges->down_count && edges->down[at->down].column == column) {
        cell.at[SIDE_LEFT] = make_end(chains, &edges->down[at->down++]); /* column 0 */
    }
    if (at->down < edges->down_count && edges->down[at->down].column == column + 1) {
        cell.at[SIDE_RIGHT] = make_end(chains, &edges->down[at->down++]);
    }
    if (at->top < chains->top_count && chains->top[at->top].column == column) {
        cell.at[SIDE_TOP] = chains->top[at->top++];
    }
    if (at->across < edges->across_count && edges->across[at->across].column == column) {
        cell.at[SIDE_BOTTOM] = make_end(chains, &edges->across[at->across]);
        chains->bottom[at->across++] = cell.at[SIDE_BOTTOM];
    }
    visit_cell(chains, &cell);
    at->left = cell.at[SIDE_RIGHT];
}

static void sweep_cells(struct chains *chains, const struct edge_row *edges)
{
    struct sweep at = {.left = no_end};
    unsigned column = next_column(chains, edges, &at);
    while (column != UINT16_MAX) {
        if (!sweep_passing(chains, edges, &at, column)) {
            sweep_any(chains, edges, &at, column);
        }
        column = next_column(chains, edges, &at);
    }
}

void chains_link_row(struct chains *chains, const struct edge_row *edges, bool first_row)
{
    if (first_row) {
        for (uint32_t i = 0; i < edges->across_count; i++) {
            chains->bottom[i] = make_end(chains, &edges->across[i]);
        }
    } else {
        sweep_cells(chains, edges);
    }
    struct chain_end *swap = chains->top;
    chains->top = chains->bottom;
    chains->bottom = swap;
    chains->top_count = edges->across_count;
}

void chains_end(struct chains *chains)
{
    for (uint32_t i = 0; i < chains->top_count; i++) {
        const uint32_t point = chains->top[i].point;
        if (point != CHAINS_NONE) {
            settle_end(chains, chains->points[point].chain);
        }
    }
    chains->top_count = 0;
}

/* Copies a contour's points to `out`, which may be NULL, and gives all that it held back. */
static void release_chain(struct chains *chains, uint32_t index, struct contour *out)
{
    struct chain *chain = &chains->chains[index];
    uint32_t point = chain->head;
    uint32_t count = 0;
    for (;;) {
        const struct chain_point at = chains->points[point];
        if (out != NULL) {
            out->x_px_q16[count] = at.x_px_q16;
            out->y_px_q16[count] = at.y_px_q16;
        }
        count++;
        const bool last = point == chain->tail;
        free_point(chains, point);
        if (last) {
            break;
        }
        point = at.next;
    }
    if (out != NULL) {
        out->count = count;
        out->closed = chain->closed;
        out->gradient_mean_q3 = fx_saturate_u16((int64_t)(chain->gradient_sum_q3 / chain->count));
    }
    chain->head = chains->chains_free;
    chains->chains_free = index;
}

bool chains_take(struct chains *chains, uint32_t shortest, struct contour *out)
{
    while (chains->finished_taken < chains->finished_count) {
        const uint32_t index = chains->finished[chains->finished_taken++];
        const struct chain *chain = &chains->chains[index];
        const bool wanted = chain->count >= shortest && !chain->overlong;
        release_chain(chains, index, wanted ? out : NULL);
        if (wanted) {
            return true;
        }
    }
    chains->finished_count = 0;
    chains->finished_taken = 0;
    return false;
}
