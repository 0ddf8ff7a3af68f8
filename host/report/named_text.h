// A file that is still to be written.
#pragma once

#include <string>

namespace rig {

struct NamedText {
    std::string name;  // inside of a folder; empty: the output is this one file
    std::string bytes;
};

}  // namespace rig
