/* Feature packets, written and read byte by byte in the order of WIRE.md.
 *
 * Positions: stored = (px + 0.5) * 2^F, so that the image's outer corner is 0 and nothing is
 * negative. */
#include "common/wire/wire.h"

#include "common/wire/bytes.h"
#include "common/wire/codes.h"
#include "common/wire/crc32c.h"
#include "common/wire/packet_header.h"

#include <assert.h>
#include <string.h>

enum {
    FRACTION_BITS_MAX = 14,
    POSITION_BITS = 23,
    PATCH_ID_MASK = 0x0fff,
    PATCH_LEVEL_3 = 0x1000,
    PATCH_RESERVED = 0xe000,
    MASK_RESERVED = 0xe000,
    PATCH_HEAD_BYTES = 4,
    LEVEL_3_MASK_BYTES = 9,
    HALF_PX_Q16 = 1 << 15
};

const char *wire_status_text(enum wire_status status)
{
    static const char *const text[WIRE_STATUS_COUNT] = {
        [WIRE_OK] = "the packet is good",
        [WIRE_SHORT] = "the packet ends before the length it states",
        [WIRE_BAD_MAGIC] = "the bytes do not begin like a packet",
        [WIRE_BAD_VERSION] = "the packet has a wire version that this program does not know",
        [WIRE_BAD_LENGTH] = "the packet states a length outside the limits or not its own",
        [WIRE_BAD_CHECKSUM] = "the packet's checksum does not fit its bytes",
        [WIRE_RESERVED_SET] = "the packet uses an extension that this program must refuse",
        [WIRE_BAD_SERIAL] = "the camera serial is empty, or not plain UTF-8 of 32 bytes at most",
        [WIRE_BAD_CLOCK] = "the clock kind is none of the known ones",
        [WIRE_BAD_IMAGE] = "the image size or the fraction bits are outside their limits",
        [WIRE_BAD_SENSOR] = "the sensor's region, binning or flips contradict the image",
        [WIRE_BAD_ORDER] = "patches or features are out of order, repeated or beyond the last",
        [WIRE_EMPTY_PATCH] = "a patch has no features",
        [WIRE_OUTSIDE_IMAGE] = "a feature lies outside the image",
        [WIRE_BAD_COUNT] = "the packet does not hold the patches and features that it states",
        [WIRE_FULL] = "the packet is full",
    };
    return (unsigned)status < WIRE_STATUS_COUNT ? text[status] : "unknown status";
}

uint8_t wire_fraction_bits(uint32_t side_px)
{
    assert(side_px >= 1 && side_px <= WIRE_SIDE_PX_MAX);
    uint8_t bits = FRACTION_BITS_MAX;
    while ((side_px << bits) > (1u << POSITION_BITS)) {
        bits--;
    }
    return bits;
}

/* Encoder. */

enum wire_status wire_begin(struct wire_writer *writer, uint8_t *bytes, size_t capacity,
                            const struct wire_header *header)
{
    assert(writer != NULL && bytes != NULL && header != NULL);
    *writer = (struct wire_writer){ .bytes = bytes, .capacity = capacity, .last_patch_id = -1 };
    struct wire_header h = *header;
    /* What follows the serial's own end is the caller's memory, and no part of the serial. */
    size_t length = 0;
    while (length < WIRE_SERIAL_BYTES && h.camera_serial[length] != 0) {
        length++;
    }
    if (h.camera_serial[length] != 0) {
        return WIRE_BAD_SERIAL;
    }
    memset(h.camera_serial + length, 0, sizeof h.camera_serial - length);
    h.fraction_bits = 0;
    const enum wire_status status = packet_header_check(&h);
    if (status != WIRE_OK) {
        return status;
    }
    if (capacity < WIRE_HEADER_BYTES) {
        return WIRE_FULL;
    }
    h.fraction_bits = wire_fraction_bits(h.width_px > h.height_px ? h.width_px : h.height_px);
    packet_header_put(bytes, &h);
    if (!packet_header_serial_is_good(bytes + PACKET_HEADER_SERIAL_AT)) {
        return WIRE_BAD_SERIAL;
    }
    writer->width_px = h.width_px;
    writer->height_px = h.height_px;
    writer->truncated = h.truncated;
    writer->fraction_bits = h.fraction_bits;
    writer->used = WIRE_HEADER_BYTES;
    return WIRE_OK;
}

static bool is_inside(int32_t px_q16, uint16_t side_px)
{
    const int64_t from_corner_q16 = (int64_t)px_q16 + HALF_PX_Q16;
    return from_corner_q16 >= 0 && from_corner_q16 < (int64_t)side_px << 16;
}

/* Rounded to the nearest step; the last half step before the far corner goes to the step before
 * it. */
static uint64_t position_of(int32_t px_q16, uint16_t side_px, uint8_t fraction_bits)
{
    const uint32_t drop = 16u - fraction_bits;
    const uint64_t from_corner_q16 = (uint64_t)((int64_t)px_q16 + HALF_PX_Q16);
    const uint64_t steps = (from_corner_q16 + ((uint64_t)1 << (drop - 1))) >> drop;
    const uint64_t last = ((uint64_t)side_px << fraction_bits) - 1;
    return steps < last ? steps : last;
}

static uint8_t *put_feature(uint8_t *to, const struct wire_feature *f, const struct wire_writer *w)
{
    uint64_t bits = position_of(f->x_px_q16, w->width_px, w->fraction_bits);     /* bits  0..22 */
    bits |= position_of(f->y_px_q16, w->height_px, w->fraction_bits) << 23;      /*      23..45 */
    bits |= (uint64_t)codes_of_sigma(f->sigma_px_q24) << 46;            /*      46..50 */
    bits |= (uint64_t)codes_of_size(f->size_px_q16) << 51;              /*      51..55 */
    for (uint32_t i = 0; i < WIRE_FEATURE_BYTES; i++) {
        to[i] = (uint8_t)((bits >> (8 * i)) & 0xff);
    }
    return to + WIRE_FEATURE_BYTES;
}

static enum wire_status check_features(const struct wire_writer *w,
                                       const struct wire_feature *features, size_t count)
{
    if (count == 0) {
        return WIRE_EMPTY_PATCH;
    }
    int32_t last = -1;
    for (size_t i = 0; i < count; i++) {
        if (features[i].index <= last || features[i].index >= WIRE_FEATURES) {
            return WIRE_BAD_ORDER;
        }
        if (!is_inside(features[i].x_px_q16, w->width_px) ||
            !is_inside(features[i].y_px_q16, w->height_px)) {
            return WIRE_OUTSIDE_IMAGE;
        }
        last = features[i].index;
    }
    return WIRE_OK;
}

enum wire_status wire_put_patch(struct wire_writer *writer, uint16_t patch_id,
                                const struct wire_feature *features, size_t count)
{
    assert(writer->used >= WIRE_HEADER_BYTES);
    assert(features != NULL || count == 0);
    if (writer->is_full) {
        return WIRE_FULL;
    }
    if (patch_id >= WIRE_IDS || patch_id <= writer->last_patch_id) {
        return WIRE_BAD_ORDER;
    }
    const enum wire_status status = check_features(writer, features, count);
    if (status != WIRE_OK) {
        return status;
    }
    const bool level_3 = features[count - 1].index >= WIRE_FEATURES_LEVEL_2;
    const size_t bytes = PATCH_HEAD_BYTES + (level_3 ? (size_t)LEVEL_3_MASK_BYTES : 0) +
                         count * WIRE_FEATURE_BYTES;
    if (bytes > writer->capacity - writer->used) {
        writer->truncated |= WIRE_TRUNCATED_PACKET;
        writer->is_full = true;
        return WIRE_FULL;
    }
    uint16_t mask = 0;
    uint8_t mask_3[LEVEL_3_MASK_BYTES] = { 0 };
    for (size_t i = 0; i < count; i++) {
        const uint32_t index = features[i].index;
        if (index < WIRE_FEATURES_LEVEL_2) {
            mask = (uint16_t)(mask | (1u << index));
        } else {
            const uint32_t bit = index - WIRE_FEATURES_LEVEL_2;
            mask_3[bit / 8] = (uint8_t)(mask_3[bit / 8] | (1u << (bit % 8)));
        }
    }
    const uint16_t head = (uint16_t)(patch_id | (level_3 ? PATCH_LEVEL_3 : 0));
    uint8_t *p = bytes_put_u16(writer->bytes + writer->used, head);
    p = bytes_put_u16(p, mask);
    if (level_3) {
        memcpy(p, mask_3, sizeof mask_3);
        p += sizeof mask_3;
    }
    for (size_t i = 0; i < count; i++) {
        p = put_feature(p, &features[i], writer);
    }
    assert(p == writer->bytes + writer->used + bytes);
    writer->used += bytes;
    writer->patch_count++;
    writer->feature_count += (uint32_t)count;
    writer->last_patch_id = patch_id;
    return WIRE_OK;
}

static uint32_t checksum_of(const uint8_t *bytes, size_t count)
{
    const uint32_t before = crc32c(0, bytes, PACKET_HEADER_CHECKSUM_AT);
    return crc32c(before, bytes + WIRE_PREFIX_BYTES, count - WIRE_PREFIX_BYTES);
}

size_t wire_finish(struct wire_writer *writer)
{
    if (writer->used == 0) {
        return 0;
    }
    assert(writer->used <= WIRE_PACKET_BYTES_MAX);
    (void)bytes_put_u32(writer->bytes + PACKET_HEADER_PACKET_BYTES_AT, (uint32_t)writer->used);
    uint8_t *p = bytes_put_u16(writer->bytes + PACKET_HEADER_TRUNCATED_AT, writer->truncated);
    p = bytes_put_u16(p, writer->patch_count);
    (void)bytes_put_u32(p, writer->feature_count);
    const uint32_t checksum = checksum_of(writer->bytes, writer->used);
    (void)bytes_put_u32(writer->bytes + PACKET_HEADER_CHECKSUM_AT, checksum);
    return writer->used;
}

/* Decoder. */

size_t wire_packet_bytes(const uint8_t prefix[WIRE_PREFIX_BYTES])
{
    const uint32_t header_bytes = bytes_get_u16(prefix + PACKET_HEADER_HEADER_BYTES_AT);
    const uint32_t packet_bytes = bytes_get_u32(prefix + PACKET_HEADER_PACKET_BYTES_AT);
    const bool good = bytes_get_u32(prefix) == PACKET_HEADER_MAGIC &&
                      header_bytes >= WIRE_HEADER_BYTES && header_bytes <= WIRE_HEADER_BYTES_MAX &&
                      packet_bytes >= header_bytes && packet_bytes <= WIRE_PACKET_BYTES_MAX;
    return good ? packet_bytes : 0;
}

static uint32_t bits_in(const uint8_t *bytes, size_t count)
{
    uint32_t bits = 0;
    for (size_t i = 0; i < count; i++) {
        for (uint32_t byte = bytes[i]; byte != 0; byte &= byte - 1) {
            bits++;
        }
    }
    return bits;
}

static uint64_t get_feature_bits(const uint8_t *from)
{
    uint64_t bits = 0;
    for (uint32_t i = 0; i < WIRE_FEATURE_BYTES; i++) {
        bits |= (uint64_t)from[i] << (8 * i);
    }
    return bits;
}

static uint32_t x_steps(uint64_t feature_bits)
{
    return (uint32_t)(feature_bits & ((1u << POSITION_BITS) - 1));
}

static uint32_t y_steps(uint64_t feature_bits)
{
    return (uint32_t)((feature_bits >> POSITION_BITS) & ((1u << POSITION_BITS) - 1));
}

/* Checks the record at `at`; adds to the packet's counts, and moves `*used` behind it. */
static enum wire_status check_patch(const uint8_t *at, size_t left, const struct wire_header *h,
                                    int32_t *last_id, uint32_t *feature_count, size_t *used)
{
    if (left < PATCH_HEAD_BYTES) {
        return WIRE_BAD_COUNT;
    }
    const uint16_t head = bytes_get_u16(at);
    if ((head & PATCH_RESERVED) != 0 || (bytes_get_u16(at + 2) & MASK_RESERVED) != 0) {
        return WIRE_RESERVED_SET;
    }
    if ((head & PATCH_ID_MASK) <= *last_id) {
        return WIRE_BAD_ORDER;
    }
    *last_id = head & PATCH_ID_MASK;
    uint32_t count = bits_in(at + 2, 2);
    size_t bytes = PATCH_HEAD_BYTES;
    if ((head & PATCH_LEVEL_3) != 0) {
        if (left < PATCH_HEAD_BYTES + LEVEL_3_MASK_BYTES) {
            return WIRE_BAD_COUNT;
        }
        const uint32_t count_3 = bits_in(at + bytes, LEVEL_3_MASK_BYTES);
        if (count_3 == 0) {
            return WIRE_EMPTY_PATCH;
        }
        count += count_3;
        bytes += LEVEL_3_MASK_BYTES;
    }
    if (count == 0) {
        return WIRE_EMPTY_PATCH;
    }
    if (left - bytes < count * WIRE_FEATURE_BYTES) {
        return WIRE_BAD_COUNT;
    }
    for (uint32_t i = 0; i < count; i++) {
        const uint64_t bits = get_feature_bits(at + bytes);
        if (x_steps(bits) >= (uint32_t)h->width_px << h->fraction_bits ||
            y_steps(bits) >= (uint32_t)h->height_px << h->fraction_bits) {
            return WIRE_OUTSIDE_IMAGE;
        }
        bytes += WIRE_FEATURE_BYTES;
    }
    *feature_count += count;
    *used = bytes;
    return WIRE_OK;
}

static enum wire_status check_patches(const uint8_t *at, size_t left, const struct wire_header *h)
{
    int32_t last_id = -1;
    uint32_t feature_count = 0;
    for (uint32_t i = 0; i < h->patch_count; i++) {
        size_t used = 0;
        const enum wire_status status = check_patch(at, left, h, &last_id, &feature_count, &used);
        if (status != WIRE_OK) {
            return status;
        }
        at += used;
        left -= used;
    }
    return left == 0 && feature_count == h->feature_count ? WIRE_OK : WIRE_BAD_COUNT;
}

/* What every version promises: length, magic, version, checksum. */
static enum wire_status check_prefix(const uint8_t *bytes, size_t count)
{
    if (count >= 4 && bytes_get_u32(bytes) != PACKET_HEADER_MAGIC) {
        return WIRE_BAD_MAGIC;
    }
    if (count < WIRE_PREFIX_BYTES) {
        return WIRE_SHORT;
    }
    const size_t packet_bytes = wire_packet_bytes(bytes);
    if (packet_bytes == 0) {
        return WIRE_BAD_LENGTH;
    }
    if (count != packet_bytes) {
        return count < packet_bytes ? WIRE_SHORT : WIRE_BAD_LENGTH;
    }
    if (bytes_get_u32(bytes + PACKET_HEADER_CHECKSUM_AT) != checksum_of(bytes, count)) {
        return WIRE_BAD_CHECKSUM;
    }
    const uint16_t version = bytes_get_u16(bytes + PACKET_HEADER_VERSION_AT);
    return version == WIRE_VERSION ? WIRE_OK : WIRE_BAD_VERSION;
}

enum wire_status wire_decode(const uint8_t *bytes, size_t count, struct wire_packet_view *view)
{
    assert((bytes != NULL || count == 0) && view != NULL);
    enum wire_status status = check_prefix(bytes, count);
    if (status != WIRE_OK) {
        return status;
    }
    if (bytes_get_u32(bytes + PACKET_HEADER_REFUSE_AT) != 0 ||
        bytes[PACKET_HEADER_REFUSE_U8_AT] != 0 ||
        bytes_get_u16(bytes + PACKET_HEADER_REFUSE_U16_AT) != 0) {
        return WIRE_RESERVED_SET;
    }
    if (!packet_header_serial_is_good(bytes + PACKET_HEADER_SERIAL_AT)) {
        return WIRE_BAD_SERIAL;
    }
    struct wire_header header;
    packet_header_get(bytes, &header);
    status = packet_header_check(&header);
    if (status != WIRE_OK) {
        return status;
    }
    const size_t header_bytes = bytes_get_u16(bytes + PACKET_HEADER_HEADER_BYTES_AT);
    status = check_patches(bytes + header_bytes, count - header_bytes, &header);
    if (status == WIRE_OK) {
        view->header = header;
        view->patches = bytes + header_bytes;
    }
    return status;
}

struct wire_patch_cursor wire_patches(const struct wire_packet_view *view)
{
    return (struct wire_patch_cursor){
        .next_record = view->patches,
        .patches_left = view->header.patch_count,
        .fraction_bits = view->header.fraction_bits,
    };
}

bool wire_next_patch(struct wire_patch_cursor *cursor)
{
    if (cursor->patches_left == 0) {
        cursor->features_left = 0;
        return false;
    }
    const uint8_t *at = cursor->next_record;
    const uint16_t head = bytes_get_u16(at);
    const size_t mask_bytes = 2 + ((head & PATCH_LEVEL_3) != 0 ? (size_t)LEVEL_3_MASK_BYTES : 0);
    cursor->patch_id = head & PATCH_ID_MASK;
    cursor->mask = at + 2;
    cursor->feature_count = (uint8_t)bits_in(at + 2, mask_bytes);
    cursor->features_left = cursor->feature_count;
    cursor->next_index = 0;
    cursor->next_feature = at + 2 + mask_bytes;
    cursor->next_record = cursor->next_feature + cursor->feature_count * WIRE_FEATURE_BYTES;
    cursor->patches_left--;
    return true;
}

static bool is_present(const uint8_t *mask, uint32_t index)
{
    /* Features 0..12 are bits of the first two bytes, 13..84 those of the nine behind. */
    const uint32_t bit = index < WIRE_FEATURES_LEVEL_2 ? index : index - WIRE_FEATURES_LEVEL_2 + 16;
    return ((mask[bit / 8] >> (bit % 8)) & 1) != 0;
}

bool wire_next_feature(struct wire_patch_cursor *cursor, struct wire_feature *feature)
{
    if (cursor->features_left == 0) {
        return false;
    }
    while (!is_present(cursor->mask, cursor->next_index)) {
        cursor->next_index++;
        assert(cursor->next_index < WIRE_FEATURES);
    }
    const uint64_t bits = get_feature_bits(cursor->next_feature);
    const uint32_t shift = 16u - cursor->fraction_bits;
    feature->x_px_q16 = (int32_t)((int64_t)((uint64_t)x_steps(bits) << shift) - HALF_PX_Q16);
    feature->y_px_q16 = (int32_t)((int64_t)((uint64_t)y_steps(bits) << shift) - HALF_PX_Q16);
    feature->sigma_px_q24 = codes_sigma_px_q24((uint32_t)(bits >> 46) & (CODES_COUNT - 1));
    feature->size_px_q16 = codes_size_px_q16((uint32_t)(bits >> 51) & (CODES_COUNT - 1));
    feature->index = cursor->next_index;
    cursor->next_index++;
    cursor->features_left--;
    cursor->next_feature += WIRE_FEATURE_BYTES;
    return true;
}
