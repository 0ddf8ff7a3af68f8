/* Luma rows, one loop a kind of container. */
#include "firmware/detect/luma.h"

#include <string.h>

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "the first pixel is the lowest byte");

/* Four bytes at a time: spread to 16 bits each and shifted, in one register. */
static void from_packed_bytes(const uint8_t *in, unsigned width, uint16_t *out)
{
    unsigned x = 0;
    for (; x + 4 <= width; x += 4) {
        uint32_t four;
        memcpy(&four, in + x, sizeof four);
        uint64_t spread = four;
        spread = (spread | spread << 16) & 0x0000ffff0000ffffu;
        spread = (spread | spread << 8) & 0x00ff00ff00ff00ffu;
        spread <<= 4;
        memcpy(out + x, &spread, sizeof spread);
    }
    for (; x < width; x++) {
        out[x] = (uint16_t)(in[x] << 4);
    }
}

static void from_bytes(const uint8_t *in, unsigned step, unsigned width, uint16_t *out)
{
    for (unsigned x = 0; x < width; x++) {
        out[x] = (uint16_t)(in[x * step] << 4);
    }
}

static void from_words(const uint8_t *in, unsigned bits, unsigned width, uint16_t *out)
{
    const unsigned largest = (1u << bits) - 1;
    for (unsigned x = 0; x < width; x++) {
        const unsigned word = in[2 * x] | (unsigned)in[2 * x + 1] << 8;
        const unsigned sample = word > largest ? largest : word;
        out[x] = (uint16_t)(bits > 12 ? sample >> (bits - 12) : sample << (12 - bits));
    }
}

void luma_span(const struct frame_view *frame, uint16_t y, uint16_t x, unsigned count,
               uint16_t *out_grey_q4)
{
    assert(y < frame->height_px && x + count <= frame->width_px);
    const uint8_t *row = frame->pixels + (size_t)y * frame->stride_bytes;
    switch (frame->format) {
    case FRAME_GREY8:
    case FRAME_NV12:
        from_packed_bytes(row + x, count, out_grey_q4);
        break;
    case FRAME_YUYV:
        from_bytes(row + 2u * x, 2, count, out_grey_q4);
        break;
    case FRAME_UYVY:
        from_bytes(row + 2u * x + 1, 2, count, out_grey_q4);
        break;
    case FRAME_GREY10:
        from_words(row + 2u * x, 10, count, out_grey_q4);
        break;
    case FRAME_GREY12:
        from_words(row + 2u * x, 12, count, out_grey_q4);
        break;
    case FRAME_GREY16:
        from_words(row + 2u * x, 16, count, out_grey_q4);
        break;
    }
}

void luma_row(const struct frame_view *frame, uint16_t y, unsigned pad, uint16_t *out_grey_q4)
{
    luma_span(frame, y, 0, frame->width_px, out_grey_q4);
    luma_pad(frame->width_px, pad, out_grey_q4);
}

void luma_halved_row(const struct frame_view *frame, uint16_t y, uint16_t *out_grey_q4)
{
    assert(y < frame->height_px / 2);
    uint16_t above[64];
    uint16_t below[64];
    const unsigned width = frame->width_px & ~1u;
    for (unsigned x = 0; x < width; x += 64) {
        const unsigned count = width - x < 64 ? width - x : 64;
        luma_span(frame, (uint16_t)(2 * y), (uint16_t)x, count, above);
        luma_span(frame, (uint16_t)(2 * y + 1), (uint16_t)x, count, below);
        for (unsigned i = 0; i < count; i += 2) {
            const int sum = above[i] + above[i + 1] + below[i] + below[i + 1];
            out_grey_q4[(x + i) / 2] = (uint16_t)((sum + 2) / 4);
        }
    }
}

void luma_pad(unsigned width, unsigned pad, uint16_t *grey_q4)
{
    for (unsigned i = 1; i <= pad; i++) {
        *(grey_q4 - i) = grey_q4[0];
        grey_q4[width - 1 + i] = grey_q4[width - 1];
    }
}
