/* One image as every stage sees it: a borrowed view, described exactly and owned by someone else.
 *
 * Whoever hands out a view says until when it holds (for the camera: between capture_next and
 * capture_release). Nobody writes through it and nobody frees it. */
#ifndef TESSERA_FIRMWARE_FRAME_H
#define TESSERA_FIRMWARE_FRAME_H

#include <assert.h>
#include <stdint.h>

/* How a row's bytes mean brightness. The detector uses luma alone, so chroma is never looked at. */
enum frame_format {
    FRAME_GREY8,  /* one byte a pixel                                                        */
    FRAME_GREY10, /* two bytes a pixel, little-endian, 0..1023; higher bits are 0            */
    FRAME_GREY12, /* two bytes a pixel, little-endian, 0..4095; higher bits are 0            */
    FRAME_GREY16, /* two bytes a pixel, little-endian, 0..65535                              */
    FRAME_YUYV,   /* two bytes a pixel: luma in the even bytes, chroma in the odd; even width */
    FRAME_UYVY,   /* two bytes a pixel: luma in the odd bytes, chroma in the even; even width */
    FRAME_NV12,   /* a plane of one luma byte a pixel; a half-high chroma plane after it     */
};

/* Row y starts at pixels + y * stride_bytes and holds frame_row_bytes() bytes that may be read;
 * all height_px rows of luma are there. The bytes need no alignment. */
struct frame_view {
    const uint8_t    *pixels;       /* first row, top left                                       */
    uint32_t          stride_bytes; /* from a row to the next, at least frame_row_bytes()        */
    uint16_t          width_px;     /* at least 1                                                */
    uint16_t          height_px;    /* at least 1                                                */
    enum frame_format format;
    int64_t           t_capture_ns; /* middle of the first row's exposure, in the source's clock */
    uint32_t          sequence;     /* the source's frame number; a gap is frames lost; wraps    */
};

/* Bytes of luma-carrying data in one row of width_px pixels. */
static inline uint32_t frame_row_bytes(enum frame_format format, uint16_t width_px)
{
    switch (format) {
    case FRAME_GREY8:
    case FRAME_NV12:
        return width_px;
    case FRAME_GREY10:
    case FRAME_GREY12:
    case FRAME_GREY16:
    case FRAME_YUYV:
    case FRAME_UYVY:
        return 2u * (uint32_t)width_px;
    }
    assert(0);
    return 0;
}

#endif
