/* Looking up features in the generated tables, and the colour rule. */
#include "common/target/layout.h"

#include <assert.h>
#include <stddef.h>

unsigned layout_feature_count(unsigned levels)
{
    switch (levels) {
    case 2:
        return LAYOUT_FEATURES_LEVEL2;
    case 3:
        return LAYOUT_FEATURES_LEVEL3;
    default:
        return 0;
    }
}

const struct layout_feature *layout_feature(unsigned levels, unsigned index)
{
    if (index < layout_feature_count(levels)) {
        return levels == 2 ? &layout_table_level2[index] : &layout_table_level3[index];
    } else {
        return NULL;
    }
}

static bool even_parity(uint16_t id)
{
    unsigned folded = id;
    folded ^= folded >> 8;
    folded ^= folded >> 4;
    folded ^= folded >> 2;
    folded ^= folded >> 1;
    return (folded & 1u) == 0;
}

bool layout_circle_is_white(unsigned levels, uint16_t patch_id, unsigned index)
{
    assert(patch_id < LAYOUT_IDS);
    const struct layout_feature *feature = layout_feature(levels, index);
    assert(feature != NULL);
    if (feature->bit == LAYOUT_ANCHOR_BIT) {
        return even_parity(patch_id);
    } else {
        return (((unsigned)patch_id >> feature->bit) & 1u) != (feature->inverted ? 1u : 0u);
    }
}

/* Triangles' corners are eighths and their sides run along multiples of 45 degrees, so that no side crosses a quarter
 * of a square of 1/8. */
unsigned layout_feature_at(unsigned levels, int32_t u_q24, int32_t v_q24)
{
    const uint32_t square_q24 = 1u << 21;
    const uint32_t last = 7;
    assert(levels == 2 || levels == 3);
    assert(u_q24 >= 0 && u_q24 <= 1 << 24 && v_q24 >= 0 && v_q24 <= 1 << 24);
    const uint32_t column = (uint32_t)u_q24 / square_q24 < last ? (uint32_t)u_q24 / square_q24 : last;
    const uint32_t row = (uint32_t)v_q24 / square_q24 < last ? (uint32_t)v_q24 / square_q24 : last;
    const uint32_t u = (uint32_t)u_q24 - column * square_q24;
    const uint32_t v = (uint32_t)v_q24 - row * square_q24;
    const unsigned quarter = (u > v ? 1u : 0u) + (u + v > square_q24 ? 2u : 0u);
    return levels == 2 ? layout_table_map2[row][column][quarter] : layout_table_map3[row][column][quarter];
}
