// tessera-rig journal: what a journal holds.
#include "host/rig/commands.h"

namespace rig {

void add_journal(CLI::App&) {}

}  // namespace rig
