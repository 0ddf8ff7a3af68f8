// Connections' bytes -> checked packets -> the journal, with counts by camera. No thinking beyond
// that.
#ifndef TESSERA_HOST_RIG_RECEIVER_H
#define TESSERA_HOST_RIG_RECEIVER_H

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "host/base/status.h"
#include "host/journal/journal.h"
#include "host/net/listener.h"
#include "host/net/packets.h"

namespace rig {

class Receiver {
 public:
  struct Camera {
    uint64_t packets = 0, features = 0;
    uint64_t lost_packets = 0;  // gaps in the packet index
    uint64_t truncated = 0;     // packets that say that a list was full
    uint32_t frames_dropped = 0;
    uint32_t connection = 0;    // the last that sent its packets; 0 once that is closed
    uint64_t boot_id = 0;
    uint32_t packet_index = 0;
  };
  // Told of what a user should know at once, as one line.
  using Note = std::function<void(const std::string& line)>;

  Receiver(JournalWriter& journal, Note note) : journal_(journal), note_(std::move(note)) {}

  Listener::Events events();

  const std::map<std::string, Camera>& cameras() const { return cameras_; }  // by serial
  uint64_t packets() const { return packets_; }
  uint64_t bytes() const { return bytes_; }
  // How many packets and features came from each camera, as one line.
  std::string summary() const;
  // Why nothing more can be written.
  const Status& journal_status() const { return journal_status_; }
  // What was wrong with connections so far; call finish() before, for those still open.
  void finish();
  uint64_t faults() const { return faults_; }
  const std::string& first_fault() const { return first_fault_; }

 private:
  struct Connection {
    std::string peer;
    PacketStream stream;
  };

  void on_open(uint32_t number, const std::string& peer);
  bool on_bytes(uint32_t number, const uint8_t* bytes, size_t count);
  void on_close(uint32_t number, const std::string& error);
  void on_packet(uint32_t number, const wire_packet_view& packet, const uint8_t* bytes,
                 size_t count);
  void count(Camera& camera, const wire_header& header);
  void fault(const std::string& peer, const std::string& what);

  JournalWriter& journal_;
  Note note_;
  std::map<uint32_t, Connection> connections_;
  std::map<std::string, Camera> cameras_;
  uint64_t packets_ = 0;
  uint64_t bytes_ = 0;
  uint64_t faults_ = 0;
  std::string first_fault_;
  Status journal_status_;
};

}  // namespace rig

#endif
