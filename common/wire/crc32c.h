/* CRC-32C (Castagnoli): the checksum of packets and journal records. */
#ifndef TESSERA_COMMON_WIRE_CRC32C_H
#define TESSERA_COMMON_WIRE_CRC32C_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Checksum of `count` bytes that follow on those already in `crc`; start with 0. Pieces may be
 * fed one after the other: the result is that of the whole. `bytes` may be null where `count` is
 * 0. */
uint32_t crc32c(uint32_t crc, const uint8_t *bytes, size_t count);

#ifdef __cplusplus
}
#endif

#endif
