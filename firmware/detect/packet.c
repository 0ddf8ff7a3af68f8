/* One patch record a patch, in the order of ids that `patches` already has. */
#include "firmware/detect/packet.h"

#include "firmware/limits.h"

void packet_init(struct packet *packet, struct arena *arena, unsigned width, unsigned height)
{
    /* Every ellipse a feature, and a patch head for each dozen. */
    const size_t features = limit_ellipses(width, height);
    packet->size = WIRE_HEADER_BYTES + features * (WIRE_FEATURE_BYTES + 1u);
    packet->bytes = arena_take(arena, packet->size, 1);
    packet->used = 0;
    packet->features = 0;
}

static bool is_inside(const struct ellipse *e, const struct wire_header *about)
{
    return e->x_px_q16 >= -32768 && e->y_px_q16 >= -32768 &&
           e->x_px_q16 < ((int32_t)about->width_px << 16) - 32768 &&
           e->y_px_q16 < ((int32_t)about->height_px << 16) - 32768;
}

static size_t fill_row(struct packet *packet, const struct wire_header *about,
                       const struct marks *marks, const struct patch *patch)
{
    size_t count = 0;
    for (unsigned i = 0; i < LAYOUT_FEATURES_MAX; i++) {
        if (patch->marks[i] == MARKS_NONE) {
            continue;
        }
        const struct mark *mark = &marks->at[patch->marks[i]];
        if (is_inside(&mark->ellipse, about)) {
            packet->row[count++] = (struct wire_feature){
                .x_px_q16 = mark->ellipse.x_px_q16,
                .y_px_q16 = mark->ellipse.y_px_q16,
                .sigma_px_q24 = mark->sigma_px_q20 < UINT32_MAX >> 4 ? mark->sigma_px_q20 << 4
                                                                     : UINT32_MAX,
                .size_px_q16 = mark->size_px_q16,
                .index = (uint8_t)i,
            };
        }
    }
    return count;
}

bool packet_build(struct packet *packet, const struct wire_header *about,
                  const struct marks *marks, const struct patches *patches)
{
    struct wire_writer writer;
    packet->used = 0;
    packet->features = 0;
    if (wire_begin(&writer, packet->bytes, packet->size, about) != WIRE_OK) {
        return false;
    }
    for (uint32_t i = 0; i < patches->count; i++) {
        const struct patch *patch = &patches->at[i];
        const size_t count = fill_row(packet, about, marks, patch);
        if (count == 0) {
            continue;
        }
        const enum wire_status status = wire_put_patch(&writer, patch->id, packet->row, count);
        /* Ids ascend and positions were checked, so room is all that can be missing; the writer then
         * marks the packet as truncated. */
        assert(status == WIRE_OK || status == WIRE_FULL);
        if (status == WIRE_OK) {
            packet->features += (uint32_t)count;
        }
    }
    packet->used = wire_finish(&writer);
    return packet->used > 0;
}
