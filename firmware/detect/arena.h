/* The caller's block of memory, dealt out once at start. */
#ifndef TESSERA_FIRMWARE_DETECT_ARENA_H
#define TESSERA_FIRMWARE_DETECT_ARENA_H

#include <assert.h>
#include <stddef.h>
#include <stdint.h>

/* With base == NULL the arena only counts: that is how a stage's need is found with the very code
 * that later takes it. */
struct arena {
    uint8_t *base;
    size_t   size;
    size_t   used;
};

/* count items of item_bytes, aligned to 16; NULL when counting. The block was sized by counting
 * first, so running out is a programmer's error. */
static inline void *arena_take(struct arena *arena, size_t count, size_t item_bytes)
{
    const size_t start = (arena->used + 15u) & ~(size_t)15u;
    arena->used = start + count * item_bytes;
    if (arena->base == NULL) {
        return NULL;
    }
    assert(arena->used <= arena->size);
    return arena->base + start;
}

#endif
