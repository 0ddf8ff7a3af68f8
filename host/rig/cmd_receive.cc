// tessera-rig receive: packets from several cameras at once into one journal.
#include "host/rig/commands.h"

namespace rig {

void add_receive(CLI::App&) {}

}  // namespace rig
