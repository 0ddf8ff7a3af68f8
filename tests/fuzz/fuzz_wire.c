/* Any bytes as a packet: the decoder must neither read beyond them nor accept what it cannot give
 * back.
 *
 * `make fuzz` leads it by coverage; tests/unit/test_fuzz_wire.c runs it over the golden packets and
 * mutations of them. */
#include "common/wire/bytes.h"
#include "common/wire/crc32c.h"
#include "common/wire/wire.h"

#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t count);

static void require(bool holds)
{
    if (!holds) {
        abort();
    }
}

static bool is_same(const struct wire_feature *a, const struct wire_feature *b)
{
    return a->index == b->index && a->x_px_q16 == b->x_px_q16 && a->y_px_q16 == b->y_px_q16 &&
           a->sigma_px_q24 == b->sigma_px_q24 && a->size_px_q16 == b->size_px_q16;
}

/* What is good must come out of the encoder and the decoder as it went in. */
static void check_round_trip(const struct wire_packet_view *view)
{
    static uint8_t again[WIRE_PACKET_BYTES_MAX];
    static struct wire_feature features[WIRE_FEATURES];
    struct wire_writer writer;
    require(wire_begin(&writer, again, sizeof again, &view->header) == WIRE_OK);
    uint32_t feature_count = 0;
    struct wire_patch_cursor at = wire_patches(view);
    while (wire_next_patch(&at)) {
        size_t count = 0;
        while (wire_next_feature(&at, &features[count])) {
            count++;
        }
        require(count == at.feature_count);
        require(wire_put_patch(&writer, at.patch_id, features, count) == WIRE_OK);
        feature_count += (uint32_t)count;
    }
    require(feature_count == view->header.feature_count);

    struct wire_packet_view second;
    require(wire_decode(again, wire_finish(&writer), &second) == WIRE_OK);
    struct wire_patch_cursor a = wire_patches(view);
    struct wire_patch_cursor b = wire_patches(&second);
    while (wire_next_patch(&a)) {
        require(wire_next_patch(&b) && a.patch_id == b.patch_id);
        struct wire_feature x;
        struct wire_feature y;
        while (wire_next_feature(&a, &x)) {
            require(wire_next_feature(&b, &y) && is_same(&x, &y));
        }
        require(!wire_next_feature(&b, &y));
    }
    require(!wire_next_patch(&b));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t count)
{
    struct wire_packet_view view;
    const enum wire_status status = wire_decode(data, count, &view);
    if (status == WIRE_OK) {
        require(wire_packet_bytes(data) == count);
        check_round_trip(&view);
    }
    if (status != WIRE_BAD_CHECKSUM) {
        return 0;
    }
    /* Nobody guesses a checksum: put it right, so that what lies behind it is reached. */
    uint8_t *sealed = malloc(count);
    require(sealed != NULL);
    memcpy(sealed, data, count);
    const uint32_t before = crc32c(0, sealed, 12);
    (void)bytes_put_u32(sealed + 12, crc32c(before, sealed + 16, count - 16));
    if (wire_decode(sealed, count, &view) == WIRE_OK) {
        check_round_trip(&view);
    }
    free(sealed);
    return 0;
}
