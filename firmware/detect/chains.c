/* One sweep a cell row over three sorted lists: the points on the row above, on this row, and in the
 * gap between them. Cells without a point are never visited. */
#include "firmware/detect/chains.h"

#include "common/fx/fx.h"
#include "firmware/detect/profile.h"
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
        chains->points_used--; /* chains_link_row has counted it */
        return CHAINS_NONE;
    }
    chains->points_free = chains->points[point].next;
    chains->chains_free = chains->chains[index].head;
    chains->points[point] = (struct chain_point){
        .x_px_q16 = edge->x_px_q16,
        .y_px_q16 = edge->y_px_q16,
        .chain = index,
    };
    chains->chains[index] = (struct chain){
        .head = point, .tail = point, .count = 1, .open = 1,
        .squares_q6 = edge->squares_q6,
    };
    return point;
}

static bool is_overlong(const struct chain *chain)
{
    return chain->count > LIMIT_CONTOUR_POINTS;
}

/* Keeps only the two ends of a contour. */
static void drop_inside(struct chains *chains, struct chain *chain)
{
    uint32_t point = chains->points[chain->head].next;
    while (point != chain->tail) {
        const uint32_t next = chains->points[point].next;
        free_point(chains, point);
        point = next;
    }
    chains->points[chain->head].next = chain->tail;
}

/* `count` of the contour's open points have seen both their cells. */
static void settle_ends(struct chains *chains, uint32_t index, uint32_t count)
{
    struct chain *chain = &chains->chains[index];
    assert(chain->open >= count);
    chain->open -= count;
    if (chain->open == 0) {
        assert(chains->finished_count < chains->chains_size);
        chains->finished[chains->finished_count++] = index;
    }
}

/* Contour `before` goes on with `after`, and takes its points over. */
static void join_chains(struct chains *chains, uint32_t before, uint32_t after)
{
    struct chain *first = &chains->chains[before];
    struct chain *second = &chains->chains[after];
    if (before == after) {
        first->closed = true;
        return;
    }
    chains->points[first->tail].next = second->head;
    chains->points[second->tail].chain = before;
    first->tail = second->tail;
    first->count += second->count;
    first->open += second->open;
    first->squares_q6 += second->squares_q6;
    if (is_overlong(first)) {
        drop_inside(chains, first);
    }
    second->head = chains->chains_free;
    chains->chains_free = after;
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
    assert(chains->chains[before].tail == cell->at[from].point &&
           chains->chains[after].head == cell->at[to].point);
    join_chains(chains, before, after);
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
            settle_ends(chains, cell->owner[i], 1);
        }
    }
}

/* How far the sweep over one row of cells has come: the next entry of each list, and the left side's point, or
 * CHAINS_NONE. */
struct sweep {
    const struct chain_end *top;
    const struct edge      *across;
    const struct edge      *down;
    struct chain_end       *bottom;
    uint32_t                left;
    uint16_t                left_column;
    bool                    left_forward;
};

/* The next cell with anything in it, or EDGES_END - 1. A point down column c is the right side of cell c - 1
 * and then the left side of cell c. */
static inline unsigned next_column(const struct sweep *at)
{
    if (at->left != CHAINS_NONE) {
        return at->left_column; /* nothing is left of it: the cell before has taken what was there */
    }
    unsigned column = at->top->column;
    column = at->across->column < column ? at->across->column : column;
    return at->down->column <= column ? at->down->column - 1u : column;
}

static inline void leave_below(struct sweep *at, uint32_t point)
{
    at->bottom->point = point;
    at->bottom->column = at->across->column;
    at->bottom->forward = at->across->forward;
    at->bottom++;
    at->across++;
}

static inline void leave_beside(struct sweep *at, uint32_t point)
{
    at->left = point;
    at->left_column = at->down->column;
    at->left_forward = at->down->forward;
    at->down++;
}

/* Lengthens the contour of point `old` by one point on the right or below; what add_point, join_chains and settle_ends
 * would do by way of a contour of its own. False, with nothing done, where it does not pass from one to the other
 * or is full. */
static inline bool pass_on(struct chains *chains, struct sweep *at, uint32_t old, bool forward,
                           bool right)
{
    const struct edge *edge = right ? at->down : at->across;
    const uint32_t index = chains->points[old].chain;
    struct chain *chain = &chains->chains[index];
    /* Both lie on sides of unlike kinds, so equal directions make one an entrance and one an exit. */
    if (forward != edge->forward || chain->count >= LIMIT_CONTOUR_POINTS) {
        return false;
    }
    const uint32_t added = chains->points_free;
    struct chain_point *point = &chains->points[added];
    chains->points_free = point->next;
    point->x_px_q16 = edge->x_px_q16;
    point->y_px_q16 = edge->y_px_q16;
    point->next = old;
    point->chain = index;
    if (forward) {
        chains->points[old].next = added;
        chain->tail = added;
    } else {
        chain->head = added;
    }
    chain->count++;
    chain->squares_q6 += edge->squares_q6;
    if (right) {
        leave_beside(at, added);
    } else {
        leave_below(at, added);
        at->left = CHAINS_NONE;
    }
    return true;
}

/* The contour of the point above goes on with that of the point on the left, or the other way; false, with nothing
 * done, where both lead in or both lead out. */
static inline bool join_two(struct chains *chains, struct sweep *at)
{
    const bool downwards = at->top->forward;
    if (downwards == at->left_forward) {
        return false;
    }
    const uint32_t above = chains->points[at->top->point].chain;
    const uint32_t beside = chains->points[at->left].chain;
    const uint32_t before = downwards ? above : beside;
    join_chains(chains, before, downwards ? beside : above);
    settle_ends(chains, before, 2);
    at->left = CHAINS_NONE;
    return true;
}

/* A new contour from the point below to the one on the right, or the other way. False, with nothing done, where both
 * lead in or both lead out. */
static inline bool begin_two(struct chains *chains, struct sweep *at)
{
    const bool downwards = at->across->forward;
    const uint32_t index = chains->chains_free;
    if (downwards == at->down->forward || index == CHAINS_NONE) {
        return false;
    }
    const uint32_t head = chains->points_free;
    const uint32_t tail = chains->points[head].next;
    const struct edge *from = downwards ? at->down : at->across;
    const struct edge *to = downwards ? at->across : at->down;
    chains->points_free = chains->points[tail].next;
    chains->chains_free = chains->chains[index].head;
    chains->points[head] = (struct chain_point){from->x_px_q16, from->y_px_q16, tail, index};
    chains->points[tail] = (struct chain_point){to->x_px_q16, to->y_px_q16, CHAINS_NONE, index};
    chains->chains[index] = (struct chain){
        .head = head, .tail = tail, .count = 2, .open = 2,
        .squares_q6 = (uint64_t)from->squares_q6 + to->squares_q6,
    };
    leave_below(at, downwards ? tail : head);
    leave_beside(at, downwards ? head : tail);
    return true;
}

/* The frequent kinds of cell, where there is room for every point: one contour passes, begins its two ways from here or
 * is joined. False, with nothing done, where it is another kind. */
static inline bool sweep_simple(struct chains *chains, struct sweep *at, unsigned column)
{
    const bool bottom = at->across->column == column;
    const bool right = at->down->column == column + 1;
    const struct chain_end *top = at->top;
    bool done;
    if (top->column != column) {
        if (at->left == CHAINS_NONE) {
            return bottom && right && begin_two(chains, at);
        }
        return right ? !bottom && pass_on(chains, at, at->left, at->left_forward, true)
                     : bottom && pass_on(chains, at, at->left, at->left_forward, false);
    }
    if (at->left != CHAINS_NONE) {
        done = !bottom && !right && join_two(chains, at);
    } else if (right) {
        done = !bottom && pass_on(chains, at, top->point, top->forward, true);
    } else {
        done = bottom && pass_on(chains, at, top->point, top->forward, false);
    }
    at->top += done;
    return done;
}

static const struct chain_end no_end = {.point = CHAINS_NONE};

/* A cell of any kind. Not inlined: the registers are for the frequent ones. */
static __attribute__((noinline)) void sweep_any(struct chains *chains, struct sweep *at, unsigned column)
{
    struct cell cell = {.at = {no_end, no_end, no_end, no_end}};
    cell.at[SIDE_LEFT] = (struct chain_end){at->left, at->left_column, at->left_forward};
    at->left = CHAINS_NONE;
    if (at->down->column == column + 1) {
        leave_beside(at, add_point(chains, at->down));
        cell.at[SIDE_RIGHT] = (struct chain_end){at->left, at->left_column, at->left_forward};
    }
    if (at->top->column == column) {
        cell.at[SIDE_TOP] = *at->top++;
    }
    if (at->across->column == column) {
        leave_below(at, add_point(chains, at->across));
        cell.at[SIDE_BOTTOM] = at->bottom[-1];
    }
    visit_cell(chains, &cell);
}

static void sweep_cells(struct chains *chains, const struct edge_row *edges)
{
    struct sweep at = {
        .top = chains->top,
        .across = edges->across,
        .down = edges->down,
        .bottom = chains->bottom,
        .left = CHAINS_NONE,
    };
    if (at.down->column == 0) {
        leave_beside(&at, add_point(chains, at.down));
    }
    const bool room = !chains->truncated && chains->points_used <= chains->points_size;
    unsigned column = next_column(&at);
    while (column < EDGES_END - 1u) {
        if (!room || !sweep_simple(chains, &at, column)) {
            struct sweep apart = at; /* so that `at` itself may live in registers */
            sweep_any(chains, &apart, column);
            at = apart;
        }
        column = next_column(&at);
    }
}

void chains_link_row(struct chains *chains, const struct edge_row *edges, bool first_row)
{
    chains->points_used += edges->across_count + edges->down_count;
    if (first_row) {
        for (uint32_t i = 0; i < edges->across_count; i++) {
            const struct edge *edge = &edges->across[i];
            chains->bottom[i] =
                (struct chain_end){add_point(chains, edge), edge->column, edge->forward};
        }
    } else {
        sweep_cells(chains, edges);
    }
    struct chain_end *swap = chains->top;
    chains->top = chains->bottom;
    chains->bottom = swap;
    chains->top_count = edges->across_count;
    chains->top[chains->top_count].column = EDGES_END;
    if (chains->points_used > chains->points_used_max) {
        chains->points_used_max = chains->points_used;
    }
}

void chains_end(struct chains *chains)
{
    for (uint32_t i = 0; i < chains->top_count; i++) {
        const uint32_t point = chains->top[i].point;
        if (point != CHAINS_NONE) {
            settle_ends(chains, chains->points[point].chain, 1);
        }
    }
    chains->top_count = 0;
}

static void copy_points(const struct chains *chains, const struct chain *chain, struct contour *out)
{
    const uint32_t count = chain->count;
    int32_t *x_px_q16 = out->x_px_q16;
    int32_t *y_px_q16 = out->y_px_q16;
    uint32_t point = chain->head;
    for (uint32_t i = 0; i < count; i++) {
        const struct chain_point *at = &chains->points[point];
        x_px_q16[i] = at->x_px_q16;
        y_px_q16[i] = at->y_px_q16;
        point = at->next;
    }
    out->count = count;
    out->closed = chain->closed;
    /* Two pixels a point; the mean is below 2^30. */
    const uint32_t mean_q6 = (uint32_t)(chain->squares_q6 / (2 * (uint64_t)count));
    out->gradient_mean_q3 = fx_saturate_u16(profile_root_q24(mean_q6) >> 12);
}

/* Gives back all that the contour held. */
static void release_chain(struct chains *chains, uint32_t index)
{
    struct chain *chain = &chains->chains[index];
    const uint32_t held = is_overlong(chain) ? 2 : chain->count;
    assert(chains->points_used >= held);
    chains->points_used -= held;
    chains->points[chain->tail].next = chains->points_free;
    chains->points_free = chain->head;
    chain->head = chains->chains_free;
    chains->chains_free = index;
}

bool chains_take(struct chains *chains, uint32_t shortest, struct contour *out)
{
    while (chains->finished_taken < chains->finished_count) {
        const uint32_t index = chains->finished[chains->finished_taken++];
        const struct chain *chain = &chains->chains[index];
        const bool wanted = chain->count >= shortest && !is_overlong(chain);
        if (wanted) {
            copy_points(chains, chain, out);
        }
        release_chain(chains, index);
        if (wanted) {
            return true;
        }
    }
    chains->finished_count = 0;
    chains->finished_taken = 0;
    return false;
}
