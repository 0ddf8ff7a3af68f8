// Any bytes as a journal: refused with a sentence that names it, or good records, damage and a torn tail that
// together are the whole file. Where the first byte is odd, checksums are put right: nobody guesses them.
#include <cstring>
#include <string>
#include <vector>

#include "common/wire/bytes.h"
#include "common/wire/crc32c.h"
#include "host/journal/journal.h"
#include "host/journal/journal_format.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

using namespace rig::journal_format;
using Bytes = std::vector<uint8_t>;

void seal(Bytes& bytes) {
  if (bytes.size() < kFileHeadBytes) return;
  (void)bytes_put_u32(&bytes[kCheckedBytes], crc32c(0, bytes.data(), kCheckedBytes));
  for (size_t at = kFileHeadBytes; at + kRecordHeadBytes <= bytes.size(); at++) {
    if (std::memcmp(&bytes[at], kMarker, sizeof kMarker) != 0) continue;
    const size_t body = bytes_get_u32(&bytes[at + 4]);
    if (body <= bytes.size() - at - kRecordHeadBytes) {
      (void)bytes_put_u32(&bytes[at + 8], crc32c(0, bytes.data() + at + kRecordHeadBytes, body));
    }
    (void)bytes_put_u32(&bytes[at + kCheckedBytes], crc32c(0, &bytes[at], kCheckedBytes));
  }
}

void read_all(rig::JournalReader& reader, size_t file_bytes) {
  rig::JournalRecord record;
  uint64_t good = file_bytes < kFileHeadBytes ? 0 : kFileHeadBytes;
  uint64_t end = good;
  while (reader.next(record)) {
    fuzz_require(record.offset >= end && record.kind < kKindsToRefuse);
    fuzz_require(record.peer.size() <= kPeerBytesMax);
    const uint64_t bytes = kRecordHeadBytes + record.peer.size() + record.content.size();
    end = record.offset + bytes;
    good += bytes;
    fuzz_require(end <= file_bytes && reader.good_end() == end);
    wire_packet_view view;
    (void)wire_decode(record.content.data(), record.content.size(), &view);
  }
  if (reader.status().ok()) {
    fuzz_require(good + reader.damage().damaged_bytes + reader.damage().torn_bytes == file_bytes);
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t count) {
  if (count < 1) return 0;
  Bytes bytes(data + 1, data + count);
  if (data[0] % 2 != 0) seal(bytes);
  const std::string path = fuzz_file(bytes.data(), bytes.size());
  auto reader = rig::JournalReader::open(path);
  if (reader.ok()) {
    read_all(reader.value(), bytes.size());
  } else {
    fuzz_require(reader.sentence().compare(0, path.size(), path) == 0);
  }
  return 0;
}
