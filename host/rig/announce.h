// Tells scripts which port the system chose.
#ifndef TESSERA_HOST_RIG_ANNOUNCE_H
#define TESSERA_HOST_RIG_ANNOUNCE_H

#include <cstdint>
#include <string>

#include "host/base/status.h"

namespace rig {

// Writes the port's number to `port_file`; where that is empty and `listen` asked for port 0, to
// standard output.
Status announce_port(uint16_t port, const std::string& listen, const std::string& port_file);

}  // namespace rig

#endif
