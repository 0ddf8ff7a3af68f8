// Files that are either written whole or not at all.
#pragma once

#include <string>

#include "host/base/status.h"

namespace rig {

// Writes to a temporary beside `path`, flushes it to the disk and renames it: a full disk or a crash
// leaves what was there before.
Status write_whole_file(const std::string& path, const std::string& bytes);

}  // namespace rig
