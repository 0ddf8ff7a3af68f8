/* CRC-32C: reflected polynomial 0x82F63B78, register starts at and is finally combined with all
 * ones.
 *
 * Naive form: for each bit, low bit first: crc = (crc >> 1) ^ (polynomial if the bit shifted out
 * is 1). Four such steps at once depend only on the four bits shifted out: hence a table of 16,
 * which a test computes again from the polynomial. A packet of 8 kB takes 16k look-ups, far below
 * one row of pixels. */
#include "common/wire/crc32c.h"

static const uint32_t nibble_table[16] = {
    0x00000000, 0x105EC76F, 0x20BD8EDE, 0x30E349B1,
    0x417B1DBC, 0x5125DAD3, 0x61C69362, 0x7198540D,
    0x82F63B78, 0x92A8FC17, 0xA24BB5A6, 0xB21572C9,
    0xC38D26C4, 0xD3D3E1AB, 0xE330A81A, 0xF36E6F75,
};

uint32_t crc32c(uint32_t crc, const uint8_t *bytes, size_t count)
{
    crc = ~crc;
    for (size_t i = 0; i < count; i++) {
        crc ^= bytes[i];
        crc = (crc >> 4) ^ nibble_table[crc & 15];
        crc = (crc >> 4) ^ nibble_table[crc & 15];
    }
    return ~crc;
}
