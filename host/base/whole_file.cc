// See whole_file.h.
#include "host/base/whole_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace rig {
namespace {

bool write_all(int file, const std::string& bytes)
{
    std::size_t done = 0;
    while (done < bytes.size()) {
        const ssize_t count = write(file, bytes.data() + done, bytes.size() - done);
        if (count < 0 && errno != EINTR) {
            return false;
        }
        done += count > 0 ? static_cast<std::size_t>(count) : 0;
    }
    return fsync(file) == 0;
}

}  // namespace

Status write_whole_file(const std::string& path, const std::string& bytes)
{
    const std::string beside = path + ".part" + std::to_string(getpid());
    const int file = open(beside.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    bool good = file >= 0 && write_all(file, bytes);
    int fault = errno;
    if (file >= 0 && close(file) != 0 && good) {
        good = false;
        fault = errno;
    }
    if (good && std::rename(beside.c_str(), path.c_str()) != 0) {
        good = false;
        fault = errno;
    }
    if (!good) {
        if (file >= 0) {
            unlink(beside.c_str());
        }
        return Status::failure("cannot write " + path + ": " + std::strerror(fault));
    }
    return Status();
}

}  // namespace rig
