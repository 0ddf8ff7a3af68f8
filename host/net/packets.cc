// Finds packets in a stream: by their magic, their length, and then their checksum.
#include "host/net/packets.h"

#include <fmt/format.h>

#include <algorithm>

namespace rig {

namespace {

constexpr uint8_t kMagic[4] = {'T', 'S', 'S', 'R'};
constexpr uint64_t kGarbageBytesMax = 1 << 20;
// Each packet with a wrong checksum is looked through for the next one: bounds that work.
constexpr uint64_t kDistrustedMax = 16;

}  // namespace

bool PacketStream::is_hopeless() const {
  return skipped_since_good_ > kGarbageBytesMax || distrusted_since_good_ > kDistrustedMax;
}

size_t PacketStream::skip(size_t bytes) {
  skipped_bytes_ += bytes;
  skipped_since_good_ += bytes;
  return bytes;
}

// Looks at the bytes from at_ on; how many of them are done with, 0 where a packet is under way.
size_t PacketStream::take(const OnPacket& on_packet) {
  const uint8_t* from = pending_.data() + at_;
  const size_t left = pending_.size() - at_;
  if (!std::equal(from, from + std::min(left, sizeof kMagic), kMagic)) {
    const uint8_t* next = std::find(from + 1, from + left, kMagic[0]);
    return skip(static_cast<size_t>(next - from));
  }
  if (left < WIRE_PREFIX_BYTES) return 0;
  const size_t bytes = wire_packet_bytes(from);
  if (bytes > left) return 0;
  wire_packet_view view;
  const wire_status status = bytes == 0 ? WIRE_BAD_LENGTH : wire_decode(from, bytes, &view);
  if (status == WIRE_OK) {
    packets_++;
    skipped_since_good_ = 0;
    distrusted_since_good_ = 0;
    on_packet(view, from, bytes);
    return bytes;
  }
  refused_[status]++;
  if (status == WIRE_BAD_LENGTH || status == WIRE_BAD_CHECKSUM) {
    // The length cannot be trusted: the next packet may begin anywhere.
    distrusted_since_good_++;
    return skip(1);
  }
  return bytes;
}

void PacketStream::feed(const uint8_t* bytes, size_t count, const OnPacket& on_packet) {
  pending_.insert(pending_.end(), bytes, bytes + count);
  while (at_ < pending_.size() && !is_hopeless()) {
    const size_t done = take(on_packet);
    if (done == 0) break;
    at_ += done;
  }
  pending_.erase(pending_.begin(), pending_.begin() + static_cast<std::ptrdiff_t>(at_));
  at_ = 0;
}

std::string PacketStream::complaint() const {
  std::string text;
  const auto add = [&text](const std::string& part) { text += (text.empty() ? "" : "; ") + part; };
  for (size_t i = 0; i < refused_.size(); i++) {
    if (refused_[i] > 0) {
      add(fmt::format("refused {} packet{}: {}", refused_[i], refused_[i] == 1 ? "" : "s",
                      wire_status_text(static_cast<wire_status>(i))));
    }
  }
  if (skipped_bytes_ > 0) {
    add(fmt::format("skipped {} bytes that belong to no packet", skipped_bytes_));
  }
  return text;
}

}  // namespace rig
