// The port file appears whole: whoever waits for it must never read half a number.
#include "host/rig/announce.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace rig {

Status announce_port(uint16_t port, const std::string& listen, const std::string& port_file) {
  if (port_file.empty()) {
    const bool was_chosen = listen.size() > 2 && listen.compare(listen.size() - 2, 2, ":0") == 0;
    if (was_chosen) fmt::print("{}\n", port);
    std::fflush(stdout);
    return Status();
  }
  const std::string beside = port_file + ".tmp";
  std::FILE* file = std::fopen(beside.c_str(), "w");
  bool good = file != nullptr && std::fprintf(file, "%u\n", unsigned{port}) > 0;
  good = file != nullptr && std::fclose(file) == 0 && good;
  good = good && std::rename(beside.c_str(), port_file.c_str()) == 0;
  if (good) return Status();
  const std::string why = std::strerror(errno);
  std::remove(beside.c_str());
  return Status::failure(port_file + ": " + why + "; name a port file that can be written");
}

}  // namespace rig
