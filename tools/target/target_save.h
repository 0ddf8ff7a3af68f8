// Writing a result file so that a failure loses nothing.
#ifndef TOOLS_TARGET_TARGET_SAVE_H
#define TOOLS_TARGET_TARGET_SAVE_H

#include <string>

#include "host/base/status.h"

namespace target_maker {

// Writes `bytes` beside `path`, then renames: `path` holds all of it or what it held before. A path
// that is no regular file (a pipe, a device) is written to directly.
rig::Status save_file(const std::string& path, const std::string& bytes);

}  // namespace target_maker

#endif
