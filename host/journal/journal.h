// Journals: every packet as it came. JOURNAL.md says what every byte means.
#ifndef TESSERA_HOST_JOURNAL_JOURNAL_H
#define TESSERA_HOST_JOURNAL_JOURNAL_H

#include <cstdint>
#include <string>
#include <vector>

#include "host/base/status.h"
#include "host/base/unique_fd.h"

namespace rig {

inline constexpr uint8_t kJournalPacket = 1;

struct JournalRecord {
  uint64_t offset = 0;       // of the record in the file
  uint8_t kind = 0;          // kJournalPacket, or one that this program does not know
  int64_t received_ns = 0;   // UTC
  uint32_t connection = 0;   // from 1
  std::string peer;
  std::vector<uint8_t> content;
};

// What a reader had to pass over.
struct JournalDamage {
  uint64_t damaged_bytes = 0;  // with good records behind them
  uint64_t torn_bytes = 0;     // at the end; known only once the end was reached
};

class JournalReader {
 public:
  static Result<JournalReader> open(const std::string& path);

  // The next good record; false at the end, or where reading failed: status() then says so.
  bool next(JournalRecord& record);

  const Status& status() const { return status_; }
  const JournalDamage& damage() const { return damage_; }
  // Where the last good record ends, or the head.
  uint64_t good_end() const { return good_end_; }

 private:
  bool fill(size_t bytes);
  bool try_record(JournalRecord& record);
  void skip_to_marker();

  std::string path_;
  UniqueFd fd_;
  std::vector<uint8_t> window_;  // of the file, from offset_ on, read up to the record in hand
  size_t at_ = 0;                // in the window
  uint64_t offset_ = 0;          // of the window in the file
  uint64_t good_end_ = 0;
  uint64_t skipped_bytes_ = 0;   // since good_end_
  bool at_end_ = false;
  JournalDamage damage_;
  Status status_;
};

class JournalWriter {
 public:
  // A new file; one that exists already is refused.
  static Result<JournalWriter> create(const std::string& path);
  // Goes on with an existing journal, after cutting off a torn tail; or a new file.
  static Result<JournalWriter> append(const std::string& path);

  // Writes one packet's record, whole or not at all.
  Status write(int64_t received_ns, uint32_t connection, const std::string& peer,
               const uint8_t* packet, size_t packet_bytes);
  // Once a second at most: makes sure that what was written survives a power failure.
  Status sync_when_due();
  // Synchronises and closes; the last chance of a disk to complain.
  Status close();

  uint64_t records_before() const { return records_before_; }  // there when appending began
  uint64_t cut_bytes() const { return cut_bytes_; }            // torn tail cut off

 private:
  static Result<JournalWriter> begin(const std::string& path, bool append);
  Status find_end();
  Status write_bytes(const std::vector<uint8_t>& bytes);

  std::string path_;
  UniqueFd fd_;
  uint64_t end_ = 0;  // of the last whole record
  uint64_t records_before_ = 0;
  uint64_t cut_bytes_ = 0;
  int64_t synced_ms_ = 0;
  bool is_dirty_ = false;
};

}  // namespace rig

#endif
