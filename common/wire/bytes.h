/* Little-endian numbers in bytes, at any address. A put gives the place behind what it wrote. */
#ifndef TESSERA_COMMON_WIRE_BYTES_H
#define TESSERA_COMMON_WIRE_BYTES_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

static inline uint8_t *bytes_put_u16(uint8_t *to, uint16_t value)
{
    to[0] = (uint8_t)(value & 0xff);
    to[1] = (uint8_t)(value >> 8);
    return to + 2;
}

static inline uint8_t *bytes_put_u32(uint8_t *to, uint32_t value)
{
    to = bytes_put_u16(to, (uint16_t)(value & 0xffff));
    return bytes_put_u16(to, (uint16_t)(value >> 16));
}

static inline uint8_t *bytes_put_u64(uint8_t *to, uint64_t value)
{
    to = bytes_put_u32(to, (uint32_t)(value & 0xffffffffu));
    return bytes_put_u32(to, (uint32_t)(value >> 32));
}

static inline uint16_t bytes_get_u16(const uint8_t *from)
{
    return (uint16_t)(from[0] | (from[1] << 8));
}

static inline uint32_t bytes_get_u32(const uint8_t *from)
{
    return bytes_get_u16(from) | ((uint32_t)bytes_get_u16(from + 2) << 16);
}

static inline uint64_t bytes_get_u64(const uint8_t *from)
{
    return bytes_get_u32(from) | ((uint64_t)bytes_get_u32(from + 4) << 32);
}

/* Two's complement without relying on how the compiler narrows. */
static inline int64_t bytes_get_i64(const uint8_t *from)
{
    const uint64_t bits = bytes_get_u64(from);
    return bits <= INT64_MAX ? (int64_t)bits : -(int64_t)(UINT64_MAX - bits) - 1;
}

#ifdef __cplusplus
}
#endif

#endif
