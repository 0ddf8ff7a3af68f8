// See digest.h.
#include "host/obs/digest.h"

#include <fmt/format.h>

#include <fstream>
#include <vector>

namespace rig {

std::string Digest::text() const
{
    return fmt::format("{:016x}", hash_);
}

Result<InputFile> digest_file(const std::string& path)
{
    std::ifstream file(path, std::ios::binary);
    if (!file) {
        return Status::failure("cannot open " + path);
    }
    Digest digest;
    std::vector<char> buffer(1 << 16);
    while (file.read(buffer.data(), static_cast<std::streamsize>(buffer.size())) || file.gcount() > 0) {
        digest.add({buffer.data(), static_cast<std::size_t>(file.gcount())});
    }
    if (file.bad()) {
        return Status::failure("cannot read " + path);
    }
    return InputFile{path, digest.text()};
}

}  // namespace rig
