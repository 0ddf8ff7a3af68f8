/* Patches -> one wire packet in a buffer of our own. common/wire/WIRE.md describes the bytes. */
#ifndef TESSERA_FIRMWARE_DETECT_PACKET_H
#define TESSERA_FIRMWARE_DETECT_PACKET_H

#include "common/wire/wire.h"
#include "firmware/detect/patches.h"

struct packet {
    uint8_t            *bytes;
    size_t              size;     /* room */
    size_t              used;     /* of the packet last built */
    uint32_t            features; /* in it */
    struct wire_feature row[LAYOUT_FEATURES_MAX];
};

void packet_init(struct packet *packet, struct arena *arena, unsigned width, unsigned height);

/* Builds the packet of one frame; `about` says all but what the detector found. A feature whose centre lies
 * outside the image is left out. False when `about` itself is not fit for a packet. */
bool packet_build(struct packet *packet, const struct wire_header *about,
                  const struct marks *marks, const struct patches *patches);

#endif
