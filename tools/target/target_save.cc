#include "tools/target/target_save.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>

namespace target_maker {

namespace {

rig::Status cannot_write(const std::string& path)
{
    return rig::Status::failure(
        fmt::format("{}: cannot be written: {}", path, std::strerror(errno)));
}

// True when every byte is accepted and the file is closed without an error; errno says why not.
bool write_and_close(int handle, const std::string& bytes, bool to_disk)
{
    std::size_t done = 0;
    while (done < bytes.size()) {
        const ssize_t step = write(handle, bytes.data() + done, bytes.size() - done);
        if (step < 0 && errno != EINTR) {
            break;
        }
        done += step > 0 ? static_cast<std::size_t>(step) : 0;
    }
    const bool written = done == bytes.size() && (!to_disk || fsync(handle) == 0);
    const int reason = errno;
    const bool closed = close(handle) == 0;
    if (!written) {
        errno = reason;
    }
    return written && closed;
}

}  // namespace

rig::Status save_file(const std::string& path, const std::string& bytes)
{
    struct stat there = {};
    const bool exists = stat(path.c_str(), &there) == 0;
    if (exists && !S_ISREG(there.st_mode)) {
        const int handle = open(path.c_str(), O_WRONLY | O_CLOEXEC);
        return handle >= 0 && write_and_close(handle, bytes, false) ? rig::Status()
                                                                     : cannot_write(path);
    }
    // Through a symbolic link the file that it names is replaced, not the link.
    std::error_code ignored;
    const std::filesystem::path real = std::filesystem::canonical(path, ignored);
    const std::string final_path = exists && !real.empty() ? real.string() : path;
    std::string part = final_path + ".XXXXXX";
    const int handle = mkostemp(part.data(), O_CLOEXEC);
    if (handle < 0) {
        return cannot_write(path);
    }
    const mode_t mask = umask(0);
    (void)umask(mask);
    const mode_t mode = exists ? there.st_mode & 07777 : 0666 & ~mask;
    const bool allowed = fchmod(handle, mode) == 0;
    if (!write_and_close(handle, bytes, true) || !allowed ||
        std::rename(part.c_str(), final_path.c_str()) != 0) {
        const rig::Status failure = cannot_write(path);
        (void)unlink(part.c_str());
        return failure;
    }
    return {};
}

}  // namespace target_maker
