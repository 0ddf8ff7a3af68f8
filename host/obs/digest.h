// FNV-1a: tells whether an input is the one that a result was made from. Not against intent.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "host/base/status.h"
#include "host/obs/observation.h"

namespace rig {

class Digest {
public:
    void add(std::string_view bytes)
    {
        for (const char byte : bytes) {
            hash_ = (hash_ ^ static_cast<unsigned char>(byte)) * 0x100000001b3u;
        }
    }
    std::string text() const;  // 16 hex digits

private:
    std::uint64_t hash_ = 0xcbf29ce484222325u;
};

// Of a whole file.
Result<InputFile> digest_file(const std::string& path);

}  // namespace rig
