// Reads journals, and passes over whatever is no good record.
#include <fcntl.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "common/wire/bytes.h"
#include "common/wire/crc32c.h"
#include "host/journal/journal.h"
#include "host/journal/journal_format.h"

namespace rig {

using namespace journal_format;

Result<JournalReader> JournalReader::open(const std::string& path) {
  JournalReader reader;
  reader.path_ = path;
  reader.fd_ = UniqueFd(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!reader.fd_.ok()) {
    return Status::failure(path + ": " + std::strerror(errno) +
                           "; name a journal that tessera-rig receive has written");
  }
  const bool has_head = reader.fill(kFileHeadBytes);
  if (!reader.status_.ok()) return reader.status_;
  const uint8_t* head = reader.window_.data();
  const size_t bytes = reader.window_.size();
  const bool is_journal =
      std::equal(kMagic, kMagic + std::min(bytes, sizeof kMagic), head) &&
      (!has_head || bytes_get_u32(head + kCheckedBytes) == crc32c(0, head, kCheckedBytes));
  if (!is_journal) {
    return Status::failure(path + ": this is not a journal; it was left as it is");
  }
  if (!has_head) {
    // The very first write was cut short: nothing was ever received.
    reader.damage_.torn_bytes = bytes;
    reader.at_ = bytes;
    return reader;
  }
  if (bytes_get_u16(head + 8) != kVersion || bytes_get_u16(head + 10) != kFileHeadBytes ||
      bytes_get_u32(head + 12) != 0) {
    return Status::failure(path + ": journal version " + std::to_string(bytes_get_u16(head + 8)) +
                           " or an extension of it is not known to this program; use a newer one");
  }
  reader.at_ = kFileHeadBytes;
  reader.good_end_ = kFileHeadBytes;
  return reader;
}

// Reads on until the window holds `bytes` bytes from at_ on; false where the file ends before.
bool JournalReader::fill(size_t bytes) {
  constexpr size_t kReadBytes = 1 << 16;
  if (window_.size() - at_ >= bytes) return true;
  // What lies before at_ is done with; forget it only here, so that scanning on costs no copies.
  window_.erase(window_.begin(), window_.begin() + static_cast<std::ptrdiff_t>(at_));
  offset_ += at_;
  at_ = 0;
  while (window_.size() < bytes && !at_end_) {
    const size_t had = window_.size();
    window_.resize(had + std::max(kReadBytes, bytes - had));
    const ssize_t got = ::read(fd_.get(), window_.data() + had, window_.size() - had);
    const int error = errno;
    window_.resize(had + (got > 0 ? static_cast<size_t>(got) : 0));
    if (got < 0 && error != EINTR) {
      status_ = Status::failure(path_ + ": " + std::strerror(error) + " at byte " +
                                std::to_string(offset_ + window_.size()));
    }
    at_end_ = got == 0 || !status_.ok();
  }
  return window_.size() >= bytes;
}

// The record at at_, where a good one begins there.
bool JournalReader::try_record(JournalRecord& record) {
  if (!fill(kRecordHeadBytes)) return false;
  const uint8_t* head = window_.data() + at_;
  if (!std::equal(kMarker, kMarker + sizeof kMarker, head) ||
      bytes_get_u32(head + kCheckedBytes) != crc32c(0, head, kCheckedBytes)) {
    return false;
  }
  const size_t body_bytes = bytes_get_u32(head + 4);
  const size_t peer_bytes = bytes_get_u16(head + 14);
  if (body_bytes > kBodyBytesMax || peer_bytes > kPeerBytesMax || peer_bytes > body_bytes ||
      !fill(kRecordHeadBytes + body_bytes)) {
    return false;
  }
  head = window_.data() + at_;  // fill may have moved it
  const uint8_t* body = head + kRecordHeadBytes;
  if (bytes_get_u32(head + 8) != crc32c(0, body, body_bytes)) return false;
  record.offset = offset_ + at_;
  record.kind = head[12];
  record.received_ns = bytes_get_i64(head + 16);
  record.connection = bytes_get_u32(head + 24);
  record.peer.assign(body, body + peer_bytes);
  record.content.assign(body + peer_bytes, body + body_bytes);
  at_ += kRecordHeadBytes + body_bytes;
  return true;
}

// Moves at_ by one byte at least, to the next byte that may begin a record.
void JournalReader::skip_to_marker() {
  const auto from = window_.begin() + static_cast<std::ptrdiff_t>(at_ + 1);
  const auto found = std::find(from, window_.end(), kMarker[0]);
  const size_t next = static_cast<size_t>(found - window_.begin());
  skipped_bytes_ += next - at_;
  at_ = next;
}

bool JournalReader::next(JournalRecord& record) {
  while (status_.ok()) {
    if (!fill(1)) break;
    if (try_record(record)) {
      damage_.damaged_bytes += skipped_bytes_;
      skipped_bytes_ = 0;
      good_end_ = offset_ + at_;
      if (record.kind < kKindsToRefuse) return true;
      status_ = Status::failure(path_ + ": the record at byte " + std::to_string(record.offset) +
                                " has a kind that this program must refuse; use a newer one");
      return false;
    }
    skip_to_marker();
  }
  if (skipped_bytes_ > 0) damage_.torn_bytes = skipped_bytes_;
  return false;
}

}  // namespace rig
