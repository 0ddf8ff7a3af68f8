/* Checking a target, finding a patch on it, and its digest. */
#include "common/target/target.h"

#include <assert.h>
#include <string.h>

static unsigned patch_count(const struct target *target)
{
    return (unsigned)target->rows * target->cols;
}

static enum target_status check_shape(const struct target *target)
{
    if (target->rows < 1 || target->cols < 1 || patch_count(target) > TARGET_PATCHES_MAX ||
        target->patch_nm < 1) {
        return TARGET_BAD_SIZE;
    }
    if (target->levels < LAYOUT_LEVELS_MIN || target->levels > LAYOUT_LEVELS_MAX) {
        return TARGET_BAD_LEVELS;
    }
    if (target->circle_ratio_q16 < 1 || target->circle_ratio_q16 > 65536 ||
        target->edge_level_q16 < 1 || target->edge_level_q16 > 65536 ||
        target->gauss_sigma_q16 < 1) {
        return TARGET_BAD_CIRCLE;
    }
    return TARGET_OK;
}

enum target_status target_prepare(struct target *target, unsigned *bad_place)
{
    enum target_status status = check_shape(target);
    if (status != TARGET_OK) {
        return status;
    }
    memset(target->place_plus_1, 0, sizeof target->place_plus_1);
    for (unsigned place = 0; place < patch_count(target); place++) {
        const uint16_t id = target->ids[place];
        *bad_place = place;
        if (id >= LAYOUT_IDS) {
            return TARGET_BAD_ID;
        }
        if (target->place_plus_1[id] != 0) {
            return TARGET_SAME_ID;
        }
        if (target->turns[place] > 1) {
            return TARGET_BAD_TURN;
        }
        target->place_plus_1[id] = (uint16_t)(place + 1);
    }
    return TARGET_OK;
}

bool target_find(const struct target *target, uint16_t id, uint16_t *row, uint16_t *col,
                 uint8_t *turn)
{
    assert(target->cols > 0);
    if (id < LAYOUT_IDS && target->place_plus_1[id] != 0) {
        const unsigned place = target->place_plus_1[id] - 1u;
        assert(target->ids[place] == id);
        *row = (uint16_t)(place / target->cols);
        *col = (uint16_t)(place % target->cols);
        *turn = target->turns[place];
        return true;
    } else {
        return false;
    }
}

static uint64_t fnv1a(uint64_t hash, uint64_t value, unsigned bytes)
{
    for (unsigned i = 0; i < bytes; i++) {
        hash = (hash ^ ((value >> (8 * i)) & 0xffu)) * UINT64_C(0x100000001b3);
    }
    return hash;
}

uint64_t target_digest(const struct target *target)
{
    uint64_t hash = UINT64_C(0xcbf29ce484222325);
    hash = fnv1a(hash, target->rows, 2);
    hash = fnv1a(hash, target->cols, 2);
    hash = fnv1a(hash, target->levels, 1);
    hash = fnv1a(hash, target->circle_ratio_q16, 4);
    hash = fnv1a(hash, target->edge_level_q16, 4);
    hash = fnv1a(hash, target->gauss_sigma_q16, 4);
    hash = fnv1a(hash, (uint64_t)target->patch_nm, 8);
    for (unsigned place = 0; place < patch_count(target); place++) {
        hash = fnv1a(hash, target->ids[place], 2);
        hash = fnv1a(hash, target->turns[place], 1);
    }
    return hash != 0 ? hash : 1;
}
