/* The header, field by field in the order of WIRE.md; offsets stand in the margin. */
#include "common/wire/packet_header.h"

#include "common/wire/bytes.h"

#include <assert.h>
#include <string.h>

enum { BINNING_MAX = 16 };

/* Length of the UTF-8 character at `at` (`left` bytes to the end), 0 where there is none or it is
 * a control character. The ranges are those of the Unicode standard's table of well-formed
 * sequences. */
static size_t character_bytes(const uint8_t *at, size_t left)
{
    const uint8_t lead = at[0];
    if (lead < 0x80) {
        return lead >= 0x20 && lead != 0x7f;
    }
    size_t bytes;
    uint8_t low = 0x80;
    uint8_t high = 0xbf;
    if (lead >= 0xc2 && lead <= 0xdf) {
        bytes = 2;
        low = lead == 0xc2 ? 0xa0 : 0x80;
    } else if (lead >= 0xe0 && lead <= 0xef) {
        bytes = 3;
        low = lead == 0xe0 ? 0xa0 : 0x80;
        high = lead == 0xed ? 0x9f : 0xbf;
    } else if (lead >= 0xf0 && lead <= 0xf4) {
        bytes = 4;
        low = lead == 0xf0 ? 0x90 : 0x80;
        high = lead == 0xf4 ? 0x8f : 0xbf;
    } else {
        return 0;
    }
    if (bytes > left || at[1] < low || at[1] > high) {
        return 0;
    }
    for (size_t i = 2; i < bytes; i++) {
        if (at[i] < 0x80 || at[i] > 0xbf) {
            return 0;
        }
    }
    return bytes;
}

bool packet_header_serial_is_good(const uint8_t serial[WIRE_SERIAL_BYTES])
{
    size_t length = 0;
    while (length < WIRE_SERIAL_BYTES && serial[length] != 0) {
        length++;
    }
    for (size_t i = length; i < WIRE_SERIAL_BYTES; i++) {
        if (serial[i] != 0) {
            return false;
        }
    }
    size_t at = 0;
    while (at < length) {
        const size_t bytes = character_bytes(serial + at, length - at);
        if (bytes == 0) {
            return false;
        }
        at += bytes;
    }
    return length > 0;
}

static bool region_is_good(uint32_t region, uint32_t pixels, uint32_t binning)
{
    return region >= pixels * (binning > 0 ? binning : 1);
}

enum wire_status packet_header_check(const struct wire_header *h)
{
    const uint32_t side_px = h->width_px > h->height_px ? h->width_px : h->height_px;
    if (h->clock_kind >= WIRE_CLOCK_COUNT) {
        return WIRE_BAD_CLOCK;
    }
    if (h->width_px < 1 || h->height_px < 1 || side_px > WIRE_SIDE_PX_MAX ||
        h->fraction_bits > wire_fraction_bits(side_px)) {
        return WIRE_BAD_IMAGE;
    }
    const bool region_unknown = h->region_x == 0 && h->region_y == 0 && h->region_width == 0 &&
                                h->region_height == 0;
    if (h->binning_x > BINNING_MAX || h->binning_y > BINNING_MAX ||
        (h->flips & ~(WIRE_FLIP_COLUMNS | WIRE_FLIP_ROWS)) != 0 ||
        (!region_unknown && (!region_is_good(h->region_width, h->width_px, h->binning_x) ||
                             !region_is_good(h->region_height, h->height_px, h->binning_y)))) {
        return WIRE_BAD_SENSOR;
    }
    return WIRE_OK;
}

void packet_header_put(uint8_t to[WIRE_HEADER_BYTES], const struct wire_header *h)
{
    uint8_t *p = bytes_put_u32(to, PACKET_HEADER_MAGIC);   /*   0 */
    p = bytes_put_u16(p, WIRE_VERSION);                     /*   4 */
    p = bytes_put_u16(p, WIRE_HEADER_BYTES);                /*   6 */
    p = bytes_put_u32(p, 0);                                /*   8 packet bytes, by wire_finish */
    p = bytes_put_u32(p, 0);                                /*  12 checksum, by wire_finish */
    p = bytes_put_u32(p, 0);                                /*  16 bits to refuse */
    p = bytes_put_u32(p, 0);                                /*  20 bits to ignore */
    memcpy(p, h->camera_serial, WIRE_SERIAL_BYTES);   /*  24 */
    p = bytes_put_u64(p + WIRE_SERIAL_BYTES, h->boot_id);   /*  56 */
    p = bytes_put_u32(p, h->sequence);                      /*  64 */
    p = bytes_put_u32(p, h->packet_index);                  /*  68 */
    p = bytes_put_u64(p, (uint64_t)h->t_capture_ns);        /*  72 */
    p = bytes_put_u32(p, h->clock_uncertainty_ns);          /*  80 */
    p = bytes_put_u32(p, h->exposure_ns);                   /*  84 */
    p = bytes_put_u32(p, h->row_time_ns);                   /*  88 */
    *p++ = h->clock_kind;                             /*  92 */
    *p++ = h->flips;                                  /*  93 */
    *p++ = h->binning_x;                              /*  94 */
    *p++ = h->binning_y;                              /*  95 */
    p = bytes_put_u16(p, h->width_px);                      /*  96 */
    p = bytes_put_u16(p, h->height_px);                     /*  98 */
    p = bytes_put_u16(p, h->region_x);                      /* 100 */
    p = bytes_put_u16(p, h->region_y);                      /* 102 */
    p = bytes_put_u16(p, h->region_width);                  /* 104 */
    p = bytes_put_u16(p, h->region_height);                 /* 106 */
    p = bytes_put_u32(p, h->frames_dropped);                /* 108 */
    p = bytes_put_u64(p, h->target_digest);                 /* 112 */
    p = bytes_put_u64(p, h->settings_digest);               /* 120 */
    p = bytes_put_u32(p, h->packets_dropped);               /* 128 */
    p = bytes_put_u16(p, h->truncated);                     /* 132; counts by wire_finish */
    p = bytes_put_u16(p, 0);                                /* 134 */
    p = bytes_put_u32(p, 0);                                /* 136 */
    *p++ = h->fraction_bits;                          /* 140 */
    *p++ = 0;                                         /* 141 to refuse */
    p = bytes_put_u16(p, 0);                                /* 142 to refuse */
    assert(p == to + WIRE_HEADER_BYTES);
    (void)p;
}

void packet_header_get(const uint8_t from[WIRE_HEADER_BYTES], struct wire_header *h)
{
    memcpy(h->camera_serial, from + 24, WIRE_SERIAL_BYTES);
    h->camera_serial[WIRE_SERIAL_BYTES] = 0;
    h->boot_id = bytes_get_u64(from + 56);
    h->sequence = bytes_get_u32(from + 64);
    h->packet_index = bytes_get_u32(from + 68);
    h->t_capture_ns = bytes_get_i64(from + 72);
    h->clock_uncertainty_ns = bytes_get_u32(from + 80);
    h->exposure_ns = bytes_get_u32(from + 84);
    h->row_time_ns = bytes_get_u32(from + 88);
    h->clock_kind = from[92];
    h->flips = from[93];
    h->binning_x = from[94];
    h->binning_y = from[95];
    h->width_px = bytes_get_u16(from + 96);
    h->height_px = bytes_get_u16(from + 98);
    h->region_x = bytes_get_u16(from + 100);
    h->region_y = bytes_get_u16(from + 102);
    h->region_width = bytes_get_u16(from + 104);
    h->region_height = bytes_get_u16(from + 106);
    h->frames_dropped = bytes_get_u32(from + 108);
    h->target_digest = bytes_get_u64(from + 112);
    h->settings_digest = bytes_get_u64(from + 120);
    h->packets_dropped = bytes_get_u32(from + 128);
    h->truncated = bytes_get_u16(from + 132);
    h->patch_count = bytes_get_u16(from + 134);
    h->feature_count = bytes_get_u32(from + 136);
    h->fraction_bits = from[140];
}
