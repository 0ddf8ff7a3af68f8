// Streams of packets cut anywhere, with garbage and damage between them.
#include "host/net/packets.h"

extern "C" {
#include "unity.h"
}

#include <cstring>
#include <string>
#include <vector>

#include "common/wire/wire.h"

extern "C" void setUp() {}
extern "C" void tearDown() {}

namespace {

using rig::PacketStream;
using Bytes = std::vector<uint8_t>;

// A packet of one patch; `number` tells it from others.
Bytes packet(uint32_t number) {
  wire_header header = {};
  std::strcpy(header.camera_serial, "cam");
  header.packet_index = number;
  header.width_px = 640;
  header.height_px = 480;
  wire_feature feature = {};
  feature.x_px_q16 = static_cast<int32_t>(number) * 65536;
  Bytes bytes(1000);
  wire_writer writer;
  TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_begin(&writer, bytes.data(), bytes.size(), &header));
  TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_put_patch(&writer, 7, &feature, 1));
  bytes.resize(wire_finish(&writer));
  return bytes;
}

Bytes operator+(Bytes a, const Bytes& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

// Packet numbers that come out of `bytes` fed in pieces of `piece` bytes: "1 2 3 ".
std::string numbers(PacketStream& stream, const Bytes& bytes, size_t piece) {
  std::string text;
  for (size_t at = 0; at < bytes.size(); at += piece) {
    const size_t count = piece < bytes.size() - at ? piece : bytes.size() - at;
    stream.feed(bytes.data() + at, count,
                [&text](const wire_packet_view& view, const uint8_t* whole, size_t whole_count) {
                  text += std::to_string(view.header.packet_index) + " ";
                  TEST_ASSERT_TRUE(packet(view.header.packet_index) ==
                                   Bytes(whole, whole + whole_count));
                });
  }
  return text;
}

void pieces_of_any_size_give_the_same_packets() {
  const Bytes bytes = packet(1) + packet(2) + packet(3);
  for (size_t piece = 1; piece <= bytes.size(); piece++) {
    PacketStream stream;
    TEST_ASSERT_EQUAL_STRING("1 2 3 ", numbers(stream, bytes, piece).c_str());
    TEST_ASSERT_EQUAL_UINT(0, stream.pending_bytes());
    TEST_ASSERT_EQUAL_STRING("", stream.complaint().c_str());
  }
}

void a_stream_split_in_two_at_every_byte_gives_the_same_packets() {
  const Bytes bytes = packet(1) + packet(2) + packet(3);
  for (size_t cut = 0; cut <= bytes.size(); cut++) {
    PacketStream stream;
    const auto middle = bytes.begin() + static_cast<std::ptrdiff_t>(cut);
    const std::string first = numbers(stream, Bytes(bytes.begin(), middle), bytes.size());
    const std::string second = numbers(stream, Bytes(middle, bytes.end()), bytes.size());
    TEST_ASSERT_EQUAL_STRING("1 2 3 ", (first + second).c_str());
  }
}

void a_cut_packet_stays_pending() {
  const Bytes whole = packet(1);
  for (size_t cut = 1; cut < whole.size(); cut++) {
    PacketStream stream;
    Bytes bytes = whole;
    bytes.resize(cut);
    TEST_ASSERT_EQUAL_STRING("", numbers(stream, bytes, 10).c_str());
    TEST_ASSERT_EQUAL_UINT(cut, stream.pending_bytes());
  }
}

void garbage_between_packets_is_skipped_and_counted() {
  const Bytes garbage = {'T', 'S', 'S', 'x', 0, 'T', 'T', 'S', 1};
  const Bytes bytes = garbage + packet(1) + garbage + garbage + packet(2);
  for (size_t piece = 1; piece <= bytes.size(); piece++) {
    PacketStream stream;
    TEST_ASSERT_EQUAL_STRING("1 2 ", numbers(stream, bytes, piece).c_str());
    TEST_ASSERT_EQUAL_UINT64(27, stream.skipped_bytes());
  }
}

void after_a_turned_bit_anywhere_the_next_packet_is_found() {
  const Bytes good = packet(1) + packet(2);
  const size_t first_bytes = packet(1).size();
  for (size_t at = 0; at < first_bytes; at++) {
    Bytes bytes = good;
    bytes[at] ^= 0x10;
    // A greater length keeps the stream waiting for what does not follow here; see the next test.
    if (at >= 8 && at < 12) continue;
    PacketStream stream;
    TEST_ASSERT_EQUAL_STRING("2 ", numbers(stream, bytes, 100).c_str());
    TEST_ASSERT_EQUAL_UINT64(first_bytes, stream.skipped_bytes());
    TEST_ASSERT_FALSE(stream.complaint().empty());
  }
}

void a_wrong_length_loses_only_its_own_packet() {
  Bytes bytes = packet(1);
  bytes[9] ^= 0x01;  // 256 bytes more or less
  for (uint32_t i = 2; i < 8; i++) bytes = bytes + packet(i);
  PacketStream stream;
  TEST_ASSERT_EQUAL_STRING("2 3 4 5 6 7 ", numbers(stream, bytes, 64).c_str());
  TEST_ASSERT_FALSE(stream.is_hopeless());
}

void endless_garbage_is_hopeless() {
  PacketStream stream;
  const Bytes garbage(1 << 16, 0x55);
  for (int i = 0; i < 16; i++) numbers(stream, garbage, garbage.size());
  TEST_ASSERT_FALSE(stream.is_hopeless());
  numbers(stream, garbage, garbage.size());
  TEST_ASSERT_TRUE(stream.is_hopeless());
}

void packets_with_wrong_checksums_only_are_hopeless() {
  Bytes bad = packet(1);
  bad.back() ^= 1;
  PacketStream stream;
  for (int i = 0; i < 16; i++) numbers(stream, bad, bad.size());
  TEST_ASSERT_FALSE(stream.is_hopeless());
  numbers(stream, bad, bad.size());
  TEST_ASSERT_TRUE(stream.is_hopeless());
  TEST_ASSERT_EQUAL_UINT64(17, stream.refused()[WIRE_BAD_CHECKSUM]);
}

}  // namespace

int main() {
  UNITY_BEGIN();
  RUN_TEST(pieces_of_any_size_give_the_same_packets);
  RUN_TEST(a_stream_split_in_two_at_every_byte_gives_the_same_packets);
  RUN_TEST(a_cut_packet_stays_pending);
  RUN_TEST(garbage_between_packets_is_skipped_and_counted);
  RUN_TEST(after_a_turned_bit_anywhere_the_next_packet_is_found);
  RUN_TEST(a_wrong_length_loses_only_its_own_packet);
  RUN_TEST(endless_garbage_is_hopeless);
  RUN_TEST(packets_with_wrong_checksums_only_are_hopeless);
  return UNITY_END();
}
