// Any bytes as what a connection brings: whole or in pieces, the same packets come out, and every byte is
// accounted for. Where the first byte is odd, packets' checksums are put right: nobody guesses them.
#include <algorithm>
#include <vector>

#include "common/wire/bytes.h"
#include "common/wire/crc32c.h"
#include "host/net/packets.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

using Bytes = std::vector<uint8_t>;

void seal(Bytes& bytes) {
  for (size_t at = 0; at + WIRE_PREFIX_BYTES <= bytes.size();) {
    const size_t length = wire_packet_bytes(&bytes[at]);
    if (length == 0 || length > bytes.size() - at) {
      at++;
      continue;
    }
    const uint32_t before = crc32c(0, &bytes[at], 12);
    (void)bytes_put_u32(&bytes[at + 12], crc32c(before, &bytes[at + 16], length - 16));
    at += length;
  }
}

// The good packets, one behind the other. Pieces of `piece` bytes, in vectors of just their size.
Bytes taken(const Bytes& bytes, size_t piece, rig::PacketStream& stream) {
  Bytes good;
  uint64_t count = 0;
  const auto on_packet = [&](const wire_packet_view& view, const uint8_t* from, size_t length) {
    fuzz_require(view.patches >= from && view.patches <= from + length);
    good.insert(good.end(), from, from + length);
    count++;
  };
  for (size_t at = 0; at < bytes.size(); at += piece) {
    const Bytes part(bytes.begin() + static_cast<std::ptrdiff_t>(at),
                     bytes.begin() + static_cast<std::ptrdiff_t>(std::min(bytes.size(), at + piece)));
    stream.feed(part.data(), part.size(), on_packet);
  }
  fuzz_require(count == stream.packets());
  uint64_t refused = 0;
  for (const uint64_t n : stream.refused()) refused += n;
  fuzz_require(stream.complaint().empty() == (refused + stream.skipped_bytes() == 0));
  return good;
}

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t count) {
  if (count < 2) return 0;
  Bytes bytes(data + 2, data + count);
  if (data[0] % 2 != 0) seal(bytes);
  rig::PacketStream whole;
  rig::PacketStream parts;
  const Bytes once = taken(bytes, bytes.size() + 1, whole);
  const Bytes again = taken(bytes, 1u + data[1], parts);
  fuzz_require(once == again && whole.packets() == parts.packets());
  fuzz_require(whole.refused() == parts.refused());
  fuzz_require(whole.skipped_bytes() == parts.skipped_bytes());
  fuzz_require(whole.pending_bytes() == parts.pending_bytes());
  fuzz_require(whole.is_hopeless() == parts.is_hopeless());
  return 0;
}
