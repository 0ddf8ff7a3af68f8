// Writes journals: one write a record, and never half of one left behind.
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <chrono>
#include <cstring>

#include "common/wire/bytes.h"
#include "common/wire/crc32c.h"
#include "host/journal/journal.h"
#include "host/journal/journal_format.h"

namespace rig {

using namespace journal_format;

namespace {

constexpr int64_t kSyncMs = 1000;

int64_t monotonic_ms() {
  using namespace std::chrono;
  return duration_cast<milliseconds>(steady_clock::now().time_since_epoch()).count();
}

int64_t utc_ns() {
  using namespace std::chrono;
  return duration_cast<nanoseconds>(system_clock::now().time_since_epoch()).count();
}

Status failure(const std::string& path, int error) {
  std::string what = path + ": " + std::strerror(error);
  if (error == ENOSPC || error == EDQUOT || error == EFBIG) {
    what += "; make room or name another file; all that was received before is kept";
  }
  return Status::failure(what);
}

void seal(uint8_t* head) { bytes_put_u32(head + kCheckedBytes, crc32c(0, head, kCheckedBytes)); }

std::vector<uint8_t> file_head() {
  std::vector<uint8_t> head(kFileHeadBytes);
  std::memcpy(head.data(), kMagic, sizeof kMagic);
  uint8_t* p = bytes_put_u16(head.data() + 8, kVersion);
  p = bytes_put_u16(p, kFileHeadBytes);
  p = bytes_put_u32(p, 0);
  p = bytes_put_u32(p, 0);
  p = bytes_put_u64(p, static_cast<uint64_t>(utc_ns()));
  assert(p == head.data() + kCheckedBytes);
  static_cast<void>(p);
  seal(head.data());
  return head;
}

// A new file's name must survive a power failure too. A folder that cannot be synchronised is no
// reason to receive nothing.
void sync_folder(const std::string& path) {
  const size_t slash = path.rfind('/');
  const std::string folder = slash == std::string::npos ? "." : path.substr(0, slash + 1);
  const UniqueFd fd(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (fd.ok()) static_cast<void>(::fsync(fd.get()));
}

}  // namespace

Result<JournalWriter> JournalWriter::create(const std::string& path) { return begin(path, false); }

Result<JournalWriter> JournalWriter::append(const std::string& path) { return begin(path, true); }

Result<JournalWriter> JournalWriter::begin(const std::string& path, bool append) {
  JournalWriter writer;
  writer.path_ = path;
  const int flags = O_RDWR | O_CREAT | O_CLOEXEC | (append ? 0 : O_EXCL);
  writer.fd_ = UniqueFd(::open(path.c_str(), flags, 0666));
  if (!writer.fd_.ok() && errno == EEXIST) {
    return Status::failure(path + ": the file exists already; name another one, or go on writing "
                                  "it with --append");
  }
  if (!writer.fd_.ok()) return failure(path, errno);
  struct stat info = {};
  if (::fstat(writer.fd_.get(), &info) != 0) return failure(path, errno);
  if (!S_ISREG(info.st_mode)) {
    return Status::failure(path + ": a journal must be a regular file");
  }
  if (::flock(writer.fd_.get(), LOCK_EX | LOCK_NB) != 0) {
    return Status::failure(path + ": another program is writing this journal");
  }
  if (info.st_size > 0) {
    const Status status = writer.find_end();
    if (!status.ok()) return status;
  }
  if (writer.end_ == 0) {
    const Status status = writer.write_bytes(file_head());
    if (!status.ok()) {
      // Nothing was ever in it: leave no empty file behind.
      if (!append) static_cast<void>(::unlink(path.c_str()));
      return status;
    }
    sync_folder(path);
  }
  writer.synced_ms_ = monotonic_ms();
  return writer;
}

// Reads an existing journal to its end, and cuts off a torn tail.
Status JournalWriter::find_end() {
  Result<JournalReader> reader = JournalReader::open(path_);
  if (!reader.ok()) return reader.status();
  JournalRecord record;
  while (reader.value().next(record)) records_before_++;
  if (!reader.value().status().ok()) return reader.value().status();
  end_ = reader.value().good_end();
  cut_bytes_ = reader.value().damage().torn_bytes;
  if (cut_bytes_ > 0 && ::ftruncate(fd_.get(), static_cast<off_t>(end_)) != 0) {
    return failure(path_, errno);
  }
  return Status();
}

// Appends all of `bytes`, or cuts off what got there and fails.
Status JournalWriter::write_bytes(const std::vector<uint8_t>& bytes) {
  size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t put = ::pwrite(fd_.get(), bytes.data() + done, bytes.size() - done,
                                 static_cast<off_t>(end_ + done));
    if (put < 0 && errno == EINTR) continue;
    if (put <= 0) {
      const int error = put < 0 ? errno : ENOSPC;
      // Where even this fails the reader passes over the torn tail.
      static_cast<void>(!::ftruncate(fd_.get(), static_cast<off_t>(end_)));
      return failure(path_, error);
    }
    done += static_cast<size_t>(put);
  }
  end_ += bytes.size();
  is_dirty_ = true;
  return Status();
}

Status JournalWriter::write(int64_t received_ns, uint32_t connection, const std::string& peer,
                            const uint8_t* packet, size_t packet_bytes) {
  assert(packet_bytes <= WIRE_PACKET_BYTES_MAX);
  const size_t peer_bytes = std::min(peer.size(), kPeerBytesMax);
  const size_t body_bytes = peer_bytes + packet_bytes;
  std::vector<uint8_t> bytes(kRecordHeadBytes + body_bytes);
  uint8_t* body = bytes.data() + kRecordHeadBytes;
  std::memcpy(body, peer.data(), peer_bytes);
  std::memcpy(body + peer_bytes, packet, packet_bytes);
  std::memcpy(bytes.data(), kMarker, sizeof kMarker);
  uint8_t* p = bytes_put_u32(bytes.data() + 4, static_cast<uint32_t>(body_bytes));
  p = bytes_put_u32(p, crc32c(0, body, body_bytes));
  *p++ = kJournalPacket;
  *p++ = 0;
  p = bytes_put_u16(p, static_cast<uint16_t>(peer_bytes));
  p = bytes_put_u64(p, static_cast<uint64_t>(received_ns));
  p = bytes_put_u32(p, connection);
  assert(p == bytes.data() + kCheckedBytes);
  static_cast<void>(p);
  seal(bytes.data());
  return write_bytes(bytes);
}

Status JournalWriter::sync_when_due() {
  if (!is_dirty_ || monotonic_ms() - synced_ms_ < kSyncMs) return Status();
  synced_ms_ = monotonic_ms();
  is_dirty_ = false;
  return ::fdatasync(fd_.get()) == 0 ? Status() : failure(path_, errno);
}

Status JournalWriter::close() {
  const int synced = ::fdatasync(fd_.get());
  const int sync_error = errno;
  if (::close(fd_.release()) != 0) return failure(path_, errno);
  return synced == 0 ? Status() : failure(path_, sync_error);
}

}  // namespace rig
