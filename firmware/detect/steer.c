/* A row of output needs `radius` rows of input above and below; each input row is filtered along x
 * once, when the first output row needs it, and lives in a ring until the last has used it. */
#include "firmware/detect/steer.h"

#include "common/fx/root.h"

void steer_init(struct steer *steer, struct arena *arena, const struct dsp_kernels *dsp,
                unsigned kernel_radius_px, uint32_t gradient_min_q3, unsigned width,
                unsigned height)
{
    assert(kernel_radius_px >= 2 && kernel_radius_px <= TAPS_RADIUS_MAX);
    assert(gradient_min_q3 >= 1 && gradient_min_q3 < 32768);
    const struct taps *taps = &taps_table[kernel_radius_px - 2];
    assert(taps->radius == kernel_radius_px);

    steer->dsp = dsp;
    steer->taps = taps;
    steer->threshold_q6 = gradient_min_q3 * gradient_min_q3;
    steer->width = width;
    steer->height = height;
    steer->filtered = 0;
    steer->halved = false;
    uint16_t *padded = arena_take(arena, width + 2u * TAPS_RADIUS_MAX, sizeof *padded);
    steer->luma_grey_q4 = padded == NULL ? NULL : padded + TAPS_RADIUS_MAX;
    const size_t apart = ((size_t)width + 7) & ~(size_t)7; /* aligned as all that is taken */
    for (unsigned i = 0; i < STEER_RING_ROWS; i++) {
        int16_t *row = arena_take(arena, 3 * apart, sizeof *row);
        steer->ring[i].smooth_q3 = row;
        steer->ring[i].first_q3 = row == NULL ? NULL : row + apart;
        steer->ring[i].second_q2 = row == NULL ? NULL : row + 2 * apart;
    }
    for (unsigned i = 0; i < 2; i++) {
        steer->rows[i].x_q3 = arena_take(arena, width, sizeof(int16_t));
        steer->rows[i].y_q3 = arena_take(arena, width, sizeof(int16_t));
        steer->rows[i].xx_q2 = arena_take(arena, width, sizeof(int16_t));
        steer->rows[i].xy_q2 = arena_take(arena, width, sizeof(int16_t));
        steer->rows[i].yy_q2 = arena_take(arena, width, sizeof(int16_t));
        steer->rows[i].strong = arena_take(arena, DSP_BITS_BYTES(width), sizeof(uint8_t));
        steer->rows[i].bright = arena_take(arena, DSP_BITS_BYTES(width), sizeof(uint8_t));
        steer->rows[i].square_q6 = arena_take(arena, width, sizeof(uint32_t));
        steer->rows[i].steered_qm6 = arena_take(arena, width, sizeof(int32_t));
    }
}

void steer_halve(const struct steer *full, struct steer *half)
{
    assert(full->width >= 2 && full->height >= 2);
    *half = *full;
    half->width = full->width / 2;
    half->height = full->height / 2;
    half->halved = true;
}

uint32_t steer_sigma_px_q16(const struct steer *steer)
{
    const uint64_t own_q16 = steer->taps->sigma_px_q16;
    if (!steer->halved) {
        return (uint32_t)own_q16;
    }
    /* Twice as wide, and a box of 2 px has 1/4 px^2 more than one of 1 px. */
    return (uint32_t)root_u64(4 * own_q16 * own_q16 + ((uint64_t)1 << 30));
}

void steer_begin(struct steer *steer)
{
    steer->filtered = 0;
}

/* Row y without its padding; bytes, the most frequent, by the vector kernels. */
static void read_row(const struct steer *steer, const struct frame_view *frame, unsigned y)
{
    const bool bytes = frame->format == FRAME_GREY8 || frame->format == FRAME_NV12;
    const size_t stride = frame->stride_bytes;
    if (bytes && steer->halved) {
        const uint8_t *above = frame->pixels + 2 * y * stride;
        steer->dsp->halve(above, above + stride, steer->width, steer->luma_grey_q4);
    } else if (bytes) {
        steer->dsp->widen(frame->pixels + y * stride, steer->width, steer->luma_grey_q4);
    } else if (steer->halved) {
        luma_halved_row(frame, (uint16_t)y, steer->luma_grey_q4);
    } else {
        luma_row(frame, (uint16_t)y, 0, steer->luma_grey_q4);
    }
}

const struct dsp_gradient *steer_row(struct steer *steer, const struct frame_view *frame,
                                     uint16_t y)
{
    assert(frame->width_px >> (steer->halved ? 1 : 0) == (int)steer->width &&
           frame->height_px >> (steer->halved ? 1 : 0) == (int)steer->height);
    const unsigned radius = steer->taps->radius;
    const unsigned ring = 2 * radius + 1;
    const unsigned last = steer->height - 1;

    while (steer->filtered <= last && steer->filtered <= y + radius) {
        read_row(steer, frame, steer->filtered);
        luma_pad(steer->width, radius, steer->luma_grey_q4);
        steer->dsp->along_x(steer->taps, steer->luma_grey_q4, steer->width,
                            &steer->ring[steer->filtered % ring]);
        steer->filtered++;
    }
    struct dsp_row around[STEER_RING_ROWS];
    for (unsigned i = 0; i < ring; i++) {
        const unsigned wanted = y + i < radius ? 0 : y + i - radius;
        around[i] = steer->ring[(wanted > last ? last : wanted) % ring];
    }
    const struct dsp_gradient *out = &steer->rows[y & 1];
    steer->dsp->along_y(steer->taps, around, steer->width, out);
    steer->dsp->sides(steer->threshold_q6, steer->width, out);
    return out;
}
