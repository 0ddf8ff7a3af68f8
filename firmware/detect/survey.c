/* See survey.h. */
#include "firmware/detect/survey.h"

#include "common/fx/fx.h"

/* A triangle's edge through a cell gives up to 32; a patch as small as can be named has a hundred. */
#define EDGES_MIN 16u
/* A few anchors are cut by the frame, and a triangle passes for one here and there. */
#define UNNAMED_FEW   2u
#define UNNAMED_SHARE 8u

void survey_init(struct survey *survey, struct arena *arena, unsigned width, unsigned height)
{
    survey->columns = (width / 2 + SURVEY_CELL_PX - 1) / SURVEY_CELL_PX;
    survey->rows = (height / 2 + SURVEY_CELL_PX - 1) / SURVEY_CELL_PX;
    survey->edges =
        arena_take(arena, (size_t)survey->columns * survey->rows, sizeof(uint16_t));
}

void survey_begin(struct survey *survey)
{
    for (size_t i = 0; i < (size_t)survey->columns * survey->rows; i++) {
        survey->edges[i] = 0;
    }
}

void survey_count(struct survey *survey, const struct edge_row *edges, unsigned y)
{
    uint16_t *row = survey->edges + (size_t)(y / SURVEY_CELL_PX) * survey->columns;
    for (uint32_t i = 0; i < edges->across_count; i++) {
        row[edges->across[i].column / SURVEY_CELL_PX]++; /* at most 32 times 32 */
    }
}

/* The cell of a place in the frame's own pixels, within 0..cells - 1. */
static unsigned cell_at(int64_t px_q16, unsigned cells)
{
    const int64_t cell = px_q16 / ((int64_t)(2 * SURVEY_CELL_PX) << 16);
    return px_q16 < 0 ? 0 : cell >= (int64_t)cells ? cells - 1 : (unsigned)cell;
}

static void explain_around(struct survey *survey, const struct ellipse *at, int64_t reach_px_q16)
{
    const unsigned left = cell_at(at->x_px_q16 - reach_px_q16, survey->columns);
    const unsigned right = cell_at(at->x_px_q16 + reach_px_q16, survey->columns);
    const unsigned top = cell_at(at->y_px_q16 - reach_px_q16, survey->rows);
    const unsigned bottom = cell_at(at->y_px_q16 + reach_px_q16, survey->rows);
    for (unsigned row = top; row <= bottom; row++) {
        for (unsigned column = left; column <= right; column++) {
            survey->edges[(size_t)row * survey->columns + column] = 0;
        }
    }
}

void survey_explain(struct survey *survey, const struct patches *patches, const struct marks *marks)
{
    const unsigned features = layout_feature_count(patches->settings.levels);
    for (uint32_t i = 0; i < patches->count; i++) {
        for (unsigned feature = 0; feature < features; feature++) {
            const uint32_t index = patches->at[i].marks[feature];
            if (index != MARKS_NONE) {
                const struct mark *mark = &marks->at[index];
                const int64_t side_px_q16 =
                    ((int64_t)mark->size_px_q16 << 20) / patches->slots[feature].radius_q20;
                explain_around(survey, &mark->ellipse, side_px_q16 * 3 / 4);
            }
        }
    }
}

uint32_t survey_left(const struct survey *survey)
{
    uint32_t left = 0;
    for (size_t i = 0; i < (size_t)survey->columns * survey->rows; i++) {
        left += survey->edges[i] >= EDGES_MIN ? 1 : 0;
    }
    return left;
}

/* Marks get their contrast when they are named and fitted; the lattice adds its own behind the others. */
static bool is_named(const struct marks *marks, const struct mark *anchor)
{
    const int64_t near_px_q16 = anchor->size_px_q16 / 2;
    for (uint32_t i = 0; i < marks->count; i++) {
        const struct mark *mark = &marks->at[i];
        if (mark->contrast_q30 != 0 &&
            fx_abs_i64((int64_t)mark->ellipse.x_px_q16 - anchor->ellipse.x_px_q16) < near_px_q16 &&
            fx_abs_i64((int64_t)mark->ellipse.y_px_q16 - anchor->ellipse.y_px_q16) < near_px_q16) {
            return true;
        }
    }
    return false;
}

bool survey_misses_anchors(const struct marks *marks, uint32_t classified)
{
    uint32_t unnamed = 0;
    uint32_t named = 0;
    for (uint32_t i = 0; i < classified; i++) {
        if (!marks->at[i].large) {
            continue;
        }
        if (marks->at[i].contrast_q30 == 0 && !is_named(marks, &marks->at[i])) {
            unnamed++;
        } else {
            named++;
        }
    }
    return unnamed > UNNAMED_FEW && unnamed * UNNAMED_SHARE > named;
}
