/* The packet's header as bytes: the part of wire.c that knows the offsets. Used by wire.c alone. */
#ifndef TESSERA_COMMON_WIRE_PACKET_HEADER_H
#define TESSERA_COMMON_WIRE_PACKET_HEADER_H

#include "common/wire/wire.h"

#define PACKET_HEADER_MAGIC 0x52535354u   /* "TSSR", first byte lowest */

/* Where the fields lie that wire.c fills in or reads before the rest. */
enum {
    PACKET_HEADER_VERSION_AT = 4,
    PACKET_HEADER_HEADER_BYTES_AT = 6,
    PACKET_HEADER_PACKET_BYTES_AT = 8,
    PACKET_HEADER_CHECKSUM_AT = 12,
    PACKET_HEADER_REFUSE_AT = 16,
    PACKET_HEADER_SERIAL_AT = 24,
    PACKET_HEADER_TRUNCATED_AT = 132,
    PACKET_HEADER_REFUSE_U8_AT = 141,
    PACKET_HEADER_REFUSE_U16_AT = 142
};

/* 1 to 32 bytes of well-formed UTF-8 without control characters, then zeros. */
bool packet_header_serial_is_good(const uint8_t serial[WIRE_SERIAL_BYTES]);

/* The ranges of all other fields. */
enum wire_status packet_header_check(const struct wire_header *header);

/* Writes all fields; length, checksum and counts as zeros. The serial must be padded with zeros. */
void packet_header_put(uint8_t to[WIRE_HEADER_BYTES], const struct wire_header *header);

/* Reads all fields, of whatever values. */
void packet_header_get(const uint8_t from[WIRE_HEADER_BYTES], struct wire_header *header);

#endif
