// The offsets of JOURNAL.md, for the reader and the writer.
#ifndef TESSERA_HOST_JOURNAL_JOURNAL_FORMAT_H
#define TESSERA_HOST_JOURNAL_JOURNAL_FORMAT_H

#include <cstddef>
#include <cstdint>

#include "common/wire/wire.h"

namespace rig::journal_format {

inline constexpr uint8_t kMagic[8] = {'T', 'S', 'S', 'R', 'J', 'R', 'N', 'L'};
inline constexpr uint8_t kMarker[4] = {'T', 'R', 'E', 'C'};
inline constexpr uint16_t kVersion = 1;
inline constexpr size_t kFileHeadBytes = 32;
inline constexpr size_t kRecordHeadBytes = 32;
inline constexpr size_t kPeerBytesMax = 256;
inline constexpr size_t kBodyBytesMax = kPeerBytesMax + WIRE_PACKET_BYTES_MAX;
inline constexpr size_t kCheckedBytes = 28;  // of either head; its checksum follows
inline constexpr uint8_t kKindsToRefuse = 128;

}  // namespace rig::journal_format

#endif
