// tessera-rig journal: what a journal holds, as text.
#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <map>
#include <memory>

#include "common/wire/wire.h"
#include "host/journal/journal.h"
#include "host/rig/commands.h"

namespace rig {

namespace {

// Quoted where a CSV reader would need it.
std::string csv_text(const std::string& text) {
  if (text.find_first_of(",\"") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

void print_list_row(const JournalRecord& record, const wire_packet_view& packet) {
  const wire_header& h = packet.header;
  fmt::print("{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}\n", record.offset, record.received_ns,
             record.connection, csv_text(record.peer), csv_text(h.camera_serial), h.boot_id,
             h.packet_index, h.sequence, h.t_capture_ns, h.clock_kind, h.width_px, h.height_px,
             h.patch_count, h.feature_count, h.truncated);
}

void print_feature_rows(const JournalRecord&, const wire_packet_view& packet) {
  const std::string camera = csv_text(packet.header.camera_serial);
  wire_patch_cursor at = wire_patches(&packet);
  wire_feature f;
  while (wire_next_patch(&at)) {
    while (wire_next_feature(&at, &f)) {
      fmt::print("{},{},{},{},{},{:.6f},{:.6f},{:.6f},{:.3f}\n", camera, packet.header.sequence,
                 packet.header.t_capture_ns, at.patch_id, f.index, f.x_px_q16 / 65536.0,
                 f.y_px_q16 / 65536.0, f.sigma_px_q24 / 16777216.0, f.size_px_q16 / 65536.0);
    }
  }
}

struct CameraTotals {
  uint64_t packets = 0, features = 0;
};

// Reads the whole journal, gives each good packet to `use`, and says at the end what was not good.
template <typename Use>
Status read_all(const std::string& path, const char* heading, const Use& use) {
  Result<JournalReader> reader = JournalReader::open(path);
  if (!reader.ok()) return reader.status();
  fmt::print("{}", heading);
  uint64_t refused = 0;
  std::string first_refusal;
  JournalRecord record;
  while (reader.value().next(record)) {
    if (record.kind != kJournalPacket) continue;
    wire_packet_view packet;
    const wire_status status = wire_decode(record.content.data(), record.content.size(), &packet);
    if (status == WIRE_OK) {
      use(record, packet);
    } else {
      if (refused == 0) {
        first_refusal = fmt::format("byte {}: {}", record.offset, wire_status_text(status));
      }
      refused++;
    }
  }
  if (!reader.value().status().ok()) return reader.value().status();
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
    return Status::failure(fmt::format("standard output: {}", std::strerror(errno)));
  }
  const JournalDamage& damage = reader.value().damage();
  if (refused > 0) {
    return Status::failure(fmt::format("{}: {} records hold no good packet, first at {}", path,
                                       refused, first_refusal));
  }
  if (damage.damaged_bytes > 0 || damage.torn_bytes > 0) {
    return Status::failure(fmt::format("{}: passed over {} damaged bytes between records and {} "
                                       "torn bytes at the end; all other records are good",
                                       path, damage.damaged_bytes, damage.torn_bytes));
  }
  return Status();
}

Status check(const std::string& path) {
  std::map<std::string, CameraTotals> cameras;
  uint64_t packets = 0;
  const auto add_packet = [&](const JournalRecord&, const wire_packet_view& packet) {
    CameraTotals& totals = cameras[packet.header.camera_serial];
    totals.packets++;
    totals.features += packet.header.feature_count;
    packets++;
  };
  const Status status = read_all(path, "", add_packet);
  if (packets > 0 || status.ok()) fmt::print("{}: {} good packets\n", path, packets);
  for (const auto& [serial, totals] : cameras) {
    fmt::print("{}: {} packets, {} features\n", serial, totals.packets, totals.features);
  }
  return status;
}

Status list(const std::string& path) {
  return read_all(path,
                  "offset,received_ns,connection,peer,camera,boot,packet,sequence,t_ns,clock,width,"
                  "height,patches,features,truncated\n",
                  print_list_row);
}

Status csv(const std::string& path) {
  return read_all(path, "camera,sequence,t_ns,patch,feature,x,y,sigma,size\n", print_feature_rows);
}

void add(CLI::App& journal, const char* name, const char* help, Status (*run)(const std::string&)) {
  const auto path = std::make_shared<std::string>();
  CLI::App* command = journal.add_subcommand(name, help);
  command->add_option("FILE", *path, "A journal of tessera-rig receive")->required();
  command->callback([path, run] { finish(run(*path)); });
}

}  // namespace

void add_journal(CLI::App& app) {
  CLI::App* journal = app.add_subcommand("journal", "Look into a journal");
  journal->require_subcommand(1);
  add(*journal, "check", "Check every record and count packets by camera", check);
  add(*journal, "list", "Print one CSV line a packet", list);
  add(*journal, "csv", "Print one CSV line a feature, (0,0) the centre of the top-left pixel", csv);
}

}  // namespace rig
