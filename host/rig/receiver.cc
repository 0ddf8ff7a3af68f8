// Writes down what the connections bring.
#include "host/rig/receiver.h"

#include <fmt/format.h>

#include <chrono>

namespace rig {

namespace {

int64_t utc_ns() {
  using namespace std::chrono;
  return duration_cast<nanoseconds>(system_clock::now().time_since_epoch()).count();
}

}  // namespace

Listener::Events Receiver::events() {
  Listener::Events events;
  events.on_open = [this](uint32_t number, const std::string& peer) { on_open(number, peer); };
  events.on_bytes = [this](uint32_t number, const uint8_t* bytes, size_t count) {
    return on_bytes(number, bytes, count);
  };
  events.on_close = [this](uint32_t number, const std::string& error) { on_close(number, error); };
  return events;
}

void Receiver::on_open(uint32_t number, const std::string& peer) {
  connections_[number].peer = peer;
}

bool Receiver::on_bytes(uint32_t number, const uint8_t* bytes, size_t count) {
  PacketStream& stream = connections_[number].stream;
  bytes_ += count;
  stream.feed(bytes, count,
              [&](const wire_packet_view& packet, const uint8_t* whole, size_t whole_count) {
                on_packet(number, packet, whole, whole_count);
              });
  return journal_status_.ok() && !stream.is_hopeless();
}

void Receiver::on_packet(uint32_t number, const wire_packet_view& packet, const uint8_t* bytes,
                         size_t count_bytes) {
  if (!journal_status_.ok()) return;
  const Connection& connection = connections_[number];
  journal_status_ = journal_.write(utc_ns(), number, connection.peer, bytes, count_bytes);
  if (!journal_status_.ok()) return;
  packets_++;
  const std::string serial = packet.header.camera_serial;
  const auto [it, is_new] = cameras_.try_emplace(serial);
  Camera& camera = it->second;
  if (is_new) note_(fmt::format("{} at {}", serial, connection.peer));
  if (camera.connection != 0 && camera.connection != number) {
    // A camera that connects again before its old connection has died looks the same for a moment.
    note_(fmt::format("two connections, from {} and {}, call themselves {}: give each camera a "
                      "serial of its own, unless it just connected again",
                      connections_[camera.connection].peer, connection.peer, serial));
  }
  camera.connection = number;
  count(camera, packet.header);
}

void Receiver::count(Camera& camera, const wire_header& header) {
  if (camera.packets > 0 && camera.boot_id == header.boot_id) {
    // Modulo 2^32; a step backwards is a packet sent again.
    const uint32_t step = header.packet_index - camera.packet_index;
    if (step > 1 && step < 0x80000000u) camera.lost_packets += step - 1;
  }
  camera.boot_id = header.boot_id;
  camera.packet_index = header.packet_index;
  camera.packets++;
  camera.features += header.feature_count;
  camera.truncated += header.truncated != 0;
  camera.frames_dropped = header.frames_dropped;
}

std::string Receiver::summary() const {
  std::string text = cameras_.empty() ? "no camera yet" : "";
  for (const auto& [serial, camera] : cameras_) {
    text += fmt::format("{}{}: {} packets, {} features", text.empty() ? "" : "; ", serial,
                        camera.packets, camera.features);
    if (camera.lost_packets > 0) text += fmt::format(", {} lost", camera.lost_packets);
    if (camera.frames_dropped > 0) {
      text += fmt::format(", {} frames dropped", camera.frames_dropped);
    }
    if (camera.truncated > 0) text += fmt::format(", {} truncated", camera.truncated);
  }
  return text;
}

void Receiver::fault(const std::string& peer, const std::string& what) {
  const std::string line = peer + ": " + what;
  faults_++;
  if (first_fault_.empty()) first_fault_ = line;
  note_(line);
}

void Receiver::on_close(uint32_t number, const std::string& error) {
  const auto it = connections_.find(number);
  const Connection& connection = it->second;
  const std::string complaint = connection.stream.complaint();
  if (!complaint.empty()) fault(connection.peer, complaint);
  // After too much garbage, or with a full disk, it was we who closed it.
  const bool was_ours = connection.stream.is_hopeless() || !journal_status_.ok();
  if (connection.stream.pending_bytes() > 0 && !was_ours) {
    fault(connection.peer, fmt::format("the connection ended after {} bytes of a packet, which is "
                                       "left out",
                                       connection.stream.pending_bytes()));
  }
  if (!error.empty() && !was_ours) fault(connection.peer, error);
  for (auto& [serial, camera] : cameras_) {
    if (camera.connection == number) camera.connection = 0;
  }
  connections_.erase(it);
}

void Receiver::finish() {
  for (const auto& [number, connection] : connections_) {
    const std::string complaint = connection.stream.complaint();
    if (!complaint.empty()) fault(connection.peer, complaint);
  }
  connections_.clear();
}

}  // namespace rig
