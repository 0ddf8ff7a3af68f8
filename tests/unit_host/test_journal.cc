// Journals written, torn at every byte, damaged in the middle, and files that are none.
extern "C" {
#include "unity.h"
}

#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "host/journal/journal.h"

namespace {

using rig::JournalReader;
using rig::JournalRecord;
using rig::JournalWriter;
using Bytes = std::vector<uint8_t>;

std::string folder;
std::string path;

Bytes read_file() {
  std::ifstream file(path, std::ios::binary);
  return Bytes(std::istreambuf_iterator<char>(file), {});
}

void write_file(const Bytes& bytes) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
}

// The content that record `number` of these tests has.
Bytes content_of(uint32_t number) {
  return Bytes(10 + 3 * number, static_cast<uint8_t>('T' + number));
}

void write_records(JournalWriter& writer, uint32_t first, uint32_t last) {
  for (uint32_t i = first; i <= last; i++) {
    const Bytes content = content_of(i);
    TEST_ASSERT_TRUE(
        writer.write(1000 + i, i, "peer" + std::to_string(i), content.data(), content.size()).ok());
  }
}

// A journal of `count` records; where each ends, the file's head first.
std::vector<size_t> make_journal(uint32_t count) {
  std::remove(path.c_str());
  auto writer = JournalWriter::create(path);
  TEST_ASSERT_TRUE(writer.ok());
  std::vector<size_t> ends = {read_file().size()};
  for (uint32_t i = 1; i <= count; i++) {
    write_records(writer.value(), i, i);
    ends.push_back(read_file().size());
  }
  TEST_ASSERT_TRUE(writer.value().close().ok());
  return ends;
}

// Numbers of the records found, each checked whole: "1 2 3 ".
std::string numbers(rig::JournalDamage* damage = nullptr) {
  auto reader = JournalReader::open(path);
  TEST_ASSERT_TRUE_MESSAGE(reader.ok(), reader.sentence().c_str());
  std::string text;
  JournalRecord record;
  while (reader.value().next(record)) {
    TEST_ASSERT_EQUAL_UINT8(rig::kJournalPacket, record.kind);
    TEST_ASSERT_EQUAL_INT64(1000 + record.connection, record.received_ns);
    TEST_ASSERT_EQUAL_STRING(("peer" + std::to_string(record.connection)).c_str(),
                             record.peer.c_str());
    TEST_ASSERT_TRUE(record.content == content_of(record.connection));
    text += std::to_string(record.connection) + " ";
  }
  TEST_ASSERT_TRUE(reader.value().status().ok());
  if (damage != nullptr) *damage = reader.value().damage();
  return text;
}

std::string numbers_up_to(size_t count) {
  std::string text;
  for (size_t i = 1; i <= count; i++) text += std::to_string(i) + " ";
  return text;
}

void what_was_written_is_read_again() {
  make_journal(5);
  rig::JournalDamage damage;
  TEST_ASSERT_EQUAL_STRING("1 2 3 4 5 ", numbers(&damage).c_str());
  TEST_ASSERT_EQUAL_UINT64(0, damage.damaged_bytes + damage.torn_bytes);
}

// Every byte of the document, pinned; only the time of creation and its checksum may differ.
void the_bytes_are_those_of_the_document() {
  make_journal(1);
  const Bytes bytes = read_file();
  const std::string head("TSSRJRNL\1\0\40\0\0\0\0\0\0\0\0\0", 20);
  TEST_ASSERT_EQUAL_UINT(32 + 32 + 5 + 13, bytes.size());
  TEST_ASSERT_TRUE(std::string(bytes.begin(), bytes.begin() + 20) == head);
  const Bytes record = {'T', 'R', 'E', 'C', 18, 0, 0, 0, 0, 0, 0, 0, 1, 0, 5, 0,
                        0xe9, 3, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0};
  for (size_t i = 0; i < record.size(); i++) {
    if (i >= 8 && i < 12) continue;  // the body's checksum: read back, so right
    TEST_ASSERT_EQUAL_HEX8(record[i], bytes[32 + i]);
  }
  TEST_ASSERT_TRUE(std::string(bytes.begin() + 64, bytes.begin() + 69) == "peer1");
}

void a_tail_torn_at_any_byte_loses_no_whole_record() {
  const std::vector<size_t> ends = make_journal(4);
  const Bytes whole = read_file();
  for (size_t cut = 0; cut <= whole.size(); cut++) {
    write_file(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(cut)));
    size_t good = 0;
    while (good + 1 < ends.size() && ends[good + 1] <= cut) good++;
    rig::JournalDamage damage;
    TEST_ASSERT_EQUAL_STRING(numbers_up_to(good).c_str(), numbers(&damage).c_str());
    const size_t good_end = cut < ends[0] ? 0 : ends[good];
    TEST_ASSERT_EQUAL_UINT64(cut - good_end, damage.torn_bytes);
    TEST_ASSERT_EQUAL_UINT64(0, damage.damaged_bytes);
  }
}

void appending_to_a_tail_torn_at_any_byte_cuts_it_off_and_goes_on() {
  const std::vector<size_t> ends = make_journal(2);
  const Bytes whole = read_file();
  for (size_t cut = 0; cut <= whole.size(); cut++) {
    write_file(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(cut)));
    const size_t good = cut < ends[1] ? 0 : cut < ends[2] ? 1 : 2;
    auto writer = JournalWriter::append(path);
    TEST_ASSERT_TRUE(writer.ok());
    TEST_ASSERT_EQUAL_UINT64(good, writer.value().records_before());
    TEST_ASSERT_EQUAL_UINT64(cut - (cut < ends[0] ? 0 : ends[good]), writer.value().cut_bytes());
    write_records(writer.value(), 3, 3);
    TEST_ASSERT_TRUE(writer.value().close().ok());
    rig::JournalDamage damage;
    TEST_ASSERT_EQUAL_STRING((numbers_up_to(good) + "3 ").c_str(), numbers(&damage).c_str());
    TEST_ASSERT_EQUAL_UINT64(0, damage.damaged_bytes + damage.torn_bytes);
  }
}

void a_turned_bit_anywhere_loses_only_the_record_that_it_is_in() {
  const std::vector<size_t> ends = make_journal(3);
  const Bytes whole = read_file();
  for (size_t at = ends[0]; at < whole.size(); at++) {
    Bytes bytes = whole;
    bytes[at] ^= 0x04;
    write_file(bytes);
    std::string expected;
    for (size_t i = 1; i < ends.size(); i++) {
      if (at < ends[i - 1] || at >= ends[i]) expected += std::to_string(i) + " ";
    }
    rig::JournalDamage damage;
    TEST_ASSERT_EQUAL_STRING(expected.c_str(), numbers(&damage).c_str());
    TEST_ASSERT_TRUE(damage.damaged_bytes + damage.torn_bytes > 0);
    const size_t hit = at >= ends[2] ? 3 : at >= ends[1] ? 2 : 1;
    TEST_ASSERT_EQUAL_UINT64(hit == 3 ? 0 : ends[hit] - ends[hit - 1], damage.damaged_bytes);
  }
}

void appending_keeps_records_behind_damage() {
  const std::vector<size_t> ends = make_journal(3);
  Bytes bytes = read_file();
  bytes[ends[1] + 40] ^= 1;
  write_file(bytes);
  auto writer = JournalWriter::append(path);
  TEST_ASSERT_TRUE(writer.ok());
  write_records(writer.value(), 4, 4);
  TEST_ASSERT_TRUE(writer.value().close().ok());
  TEST_ASSERT_EQUAL_STRING("1 3 4 ", numbers().c_str());
}

void foreign_files_are_refused_and_left_as_they_are() {
  const char* const texts[] = {"hello", "TSSRJRNX and more text than a head has bytes in it",
                               "TSSRJRNL but not a head: the checksum is wrong for that"};
  for (const char* text : texts) {
    const std::string s = text;
    write_file(Bytes(s.begin(), s.end()));
    TEST_ASSERT_FALSE(JournalReader::open(path).ok());
    TEST_ASSERT_FALSE(JournalWriter::append(path).ok());
    TEST_ASSERT_FALSE(JournalWriter::create(path).ok());
    TEST_ASSERT_TRUE(read_file() == Bytes(s.begin(), s.end()));
  }
}

void another_version_is_refused() {
  make_journal(1);
  Bytes bytes = read_file();
  bytes[8] = 2;
  write_file(bytes);
  TEST_ASSERT_FALSE(JournalReader::open(path).ok());
}

void creating_does_not_touch_a_file_that_exists() {
  make_journal(2);
  const auto writer = JournalWriter::create(path);
  TEST_ASSERT_FALSE(writer.ok());
  TEST_ASSERT_TRUE(writer.sentence().find("--append") != std::string::npos);
  TEST_ASSERT_EQUAL_STRING("1 2 ", numbers().c_str());
}

void a_journal_has_one_writer_at_a_time() {
  make_journal(1);
  auto first = JournalWriter::append(path);
  TEST_ASSERT_TRUE(first.ok());
  TEST_ASSERT_FALSE(JournalWriter::append(path).ok());
}

void a_missing_file_and_a_missing_folder_get_a_sentence() {
  std::remove(path.c_str());
  TEST_ASSERT_TRUE(JournalReader::open(path).sentence().find(path) == 0);
  TEST_ASSERT_FALSE(JournalWriter::create(folder + "/none/journal").ok());
  TEST_ASSERT_FALSE(JournalWriter::append("/dev/full").ok());
}

// The limit on a file's size stands for a full disk: at every byte where it may strike, all records
// before stay and no half one is left.
void a_full_disk_keeps_every_record_before_it() {
  const std::vector<size_t> ends = make_journal(4);
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before;
  TEST_ASSERT_EQUAL_INT(0, getrlimit(RLIMIT_FSIZE, &before));
  for (size_t limit = 1; limit < ends[4]; limit += 3) {
    std::remove(path.c_str());
    rlimit small = before;
    small.rlim_cur = limit;
    TEST_ASSERT_EQUAL_INT(0, setrlimit(RLIMIT_FSIZE, &small));
    size_t written = 0;
    {
      auto writer = JournalWriter::create(path);
      bool good = writer.ok();
      while (good && written < 4) {
        const Bytes content = content_of(static_cast<uint32_t>(written + 1));
        const auto status = writer.value().write(
            1001 + static_cast<int64_t>(written), static_cast<uint32_t>(written + 1),
            "peer" + std::to_string(written + 1), content.data(), content.size());
        good = status.ok();
        written += good;
        if (!good) TEST_ASSERT_TRUE(status.sentence().find(path) == 0);
      }
      TEST_ASSERT_FALSE(good);
    }
    TEST_ASSERT_EQUAL_INT(0, setrlimit(RLIMIT_FSIZE, &before));
    if (limit < ends[0]) {
      TEST_ASSERT_TRUE(access(path.c_str(), F_OK) != 0);
      continue;
    }
    rig::JournalDamage damage;
    TEST_ASSERT_EQUAL_STRING(numbers_up_to(written).c_str(), numbers(&damage).c_str());
    TEST_ASSERT_EQUAL_UINT64(0, damage.torn_bytes);
    TEST_ASSERT_TRUE(ends[written] <= limit && ends[written + 1] > limit);
  }
}

}  // namespace

extern "C" void setUp() {
  char name[] = "/tmp/test_journal_XXXXXX";
  TEST_ASSERT_NOT_NULL(mkdtemp(name));
  folder = name;
  path = folder + "/journal";
}

extern "C" void tearDown() {
  std::remove(path.c_str());
  rmdir(folder.c_str());
}

int main() {
  UNITY_BEGIN();
  RUN_TEST(what_was_written_is_read_again);
  RUN_TEST(the_bytes_are_those_of_the_document);
  RUN_TEST(a_tail_torn_at_any_byte_loses_no_whole_record);
  RUN_TEST(appending_to_a_tail_torn_at_any_byte_cuts_it_off_and_goes_on);
  RUN_TEST(a_turned_bit_anywhere_loses_only_the_record_that_it_is_in);
  RUN_TEST(appending_keeps_records_behind_damage);
  RUN_TEST(foreign_files_are_refused_and_left_as_they_are);
  RUN_TEST(another_version_is_refused);
  RUN_TEST(creating_does_not_touch_a_file_that_exists);
  RUN_TEST(a_journal_has_one_writer_at_a_time);
  RUN_TEST(a_missing_file_and_a_missing_folder_get_a_sentence);
  RUN_TEST(a_full_disk_keeps_every_record_before_it);
  return UNITY_END();
}
