// Cuts one connection's bytes into whole packets, checks each, and counts what it refuses and why.
#ifndef TESSERA_HOST_NET_PACKETS_H
#define TESSERA_HOST_NET_PACKETS_H

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "common/wire/wire.h"

namespace rig {

class PacketStream {
 public:
  // Called with each good packet and its bytes, which live only during the call.
  using OnPacket =
      std::function<void(const wire_packet_view& packet, const uint8_t* bytes, size_t count)>;

  // Takes the next bytes, in pieces of any size.
  void feed(const uint8_t* bytes, size_t count, const OnPacket& on_packet);

  uint64_t packets() const { return packets_; }
  // Whole packets refused, by reason.
  const std::array<uint64_t, WIRE_STATUS_COUNT>& refused() const { return refused_; }
  // Bytes that belonged to no packet.
  uint64_t skipped_bytes() const { return skipped_bytes_; }
  // Bytes of a packet whose end has not come.
  size_t pending_bytes() const { return pending_.size(); }
  // So much garbage without a good packet that going on is a waste: close the connection.
  bool is_hopeless() const;
  // What was refused, as one sentence without a full stop; empty when nothing was.
  std::string complaint() const;

 private:
  size_t take(const OnPacket& on_packet);
  size_t skip(size_t bytes);

  std::vector<uint8_t> pending_;
  size_t at_ = 0;  // in pending_
  uint64_t packets_ = 0;
  std::array<uint64_t, WIRE_STATUS_COUNT> refused_{};
  uint64_t skipped_bytes_ = 0;
  uint64_t skipped_since_good_ = 0;
  uint64_t distrusted_since_good_ = 0;  // packets whose length could not be trusted
};

}  // namespace rig

#endif
