// Listens on one address and reads from several connections at once, in one thread.
#ifndef TESSERA_HOST_NET_LISTENER_H
#define TESSERA_HOST_NET_LISTENER_H

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "host/base/status.h"
#include "host/base/unique_fd.h"

namespace rig {

class Listener {
 public:
  // What happens on connections; each has a number, from 1. `on_bytes` may say false: then the
  // connection is closed, and `on_close` follows.
  struct Events {
    std::function<void(uint32_t connection, const std::string& peer)> on_open;
    std::function<bool(uint32_t connection, const uint8_t* bytes, size_t count)> on_bytes;
    // `error` is empty where the other side closed in good order.
    std::function<void(uint32_t connection, const std::string& error)> on_close;
  };

  // `address` is ADDR:PORT, [IPv6]:PORT or :PORT for all addresses; port 0 lets the system choose.
  static Result<Listener> open(const std::string& address);

  uint16_t port() const { return port_; }
  size_t connections() const { return connections_.size(); }

  // Waits up to `timeout_ms` for anything to happen and handles it; returns early where `wake_fd`
  // (-1: none) becomes readable. Failure only where listening itself is impossible.
  Status poll(int timeout_ms, int wake_fd, const Events& events);

 private:
  void accept_all(const Events& events);
  bool read_from(uint32_t connection, int fd, const Events& events);

  UniqueFd fd_;
  uint16_t port_ = 0;
  uint32_t last_connection_ = 0;
  std::map<uint32_t, UniqueFd> connections_;
  std::vector<uint8_t> buffer_;
};

}  // namespace rig

#endif
