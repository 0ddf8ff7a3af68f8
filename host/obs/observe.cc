// See observe.h.
#include "host/obs/observe.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <tuple>

#include "common/wire/wire.h"
#include "host/assoc/instants.h"
#include "host/journal/journal.h"
#include "host/obs/digest.h"
#include "host/obs/observations_file.h"
#include "host/obs/scene.h"

namespace rig {
namespace {

struct Sighting {
    std::int64_t point = 0;  // patch id * 128 + feature index
    Eigen::Vector2d pixel;
    double sigma_px = 0.0;
};

struct Packet {
    wire_header header;
    std::string camera;
    std::vector<Sighting> sightings;
};

Packet unpack(const wire_packet_view& view)
{
    Packet packet{view.header, view.header.camera_serial, {}};
    wire_patch_cursor cursor = wire_patches(&view);
    while (wire_next_patch(&cursor)) {
        wire_feature feature;
        while (wire_next_feature(&cursor, &feature)) {
            packet.sightings.push_back({std::int64_t{cursor.patch_id} * 128 + feature.index,
                                        {feature.x_px_q16 / 65536.0, feature.y_px_q16 / 65536.0},
                                        feature.sigma_px_q24 / 16777216.0});
        }
    }
    return packet;
}

Status read_journal(const std::string& path, Scene* scene, std::vector<Packet>* packets)
{
    Result<JournalReader> reader = JournalReader::open(path);
    if (!reader.ok()) {
        return reader.status();
    }
    JournalRecord record;
    while (reader.value().next(record)) {
        wire_packet_view view;
        if (record.kind != kJournalPacket) {
            ++scene->rejected["journal record of an unknown kind"];
        } else if (wire_decode(record.content.data(), record.content.size(), &view) != WIRE_OK) {
            ++scene->rejected["packet that does not decode"];
        } else {
            packets->push_back(unpack(view));
        }
    }
    return reader.value().status();
}

Status read_targets(const std::vector<std::string>& targets, Scene* scene,
                    std::unordered_map<std::int64_t, std::size_t>* board_of_point,
                    std::map<std::uint64_t, std::string>* path_of_digest)
{
    for (const std::string& path : targets) {
        std::uint64_t digest = 0;
        Result<Board> board = read_target_board(path, &digest);
        if (!board.ok()) {
            return board.status();
        }
        path_of_digest->emplace(digest, path);
        for (const BoardPoint& point : board.value().points) {
            if (!board_of_point->emplace(point.id, scene->boards.size()).second) {
                return Status::failure(fmt::format("{}: patch {} stands on another given target too; "
                                                   "targets seen together must not share patches",
                                                   path, point.id / 128));
            }
        }
        Result<InputFile> input = digest_file(path);
        if (!input.ok()) {
            return input.status();
        }
        scene->inputs.push_back(input.value());
        board.value().group = static_cast<int>(scene->boards.size());
        scene->boards.push_back(std::move(board.value()));
    }
    return Status();
}

// One order whatever journals the packets came in; the same packet from two journals goes once.
void sort_packets(Scene* scene, std::vector<Packet>* packets)
{
    const auto key = [](const Packet& p) {
        return std::make_tuple(std::cref(p.camera), p.header.t_capture_ns, p.header.boot_id,
                               p.header.packet_index);
    };
    std::stable_sort(packets->begin(), packets->end(),
                     [&](const Packet& a, const Packet& b) { return key(a) < key(b); });
    const auto twice = std::unique(packets->begin(), packets->end(),
                                   [&](const Packet& a, const Packet& b) { return key(a) == key(b); });
    if (twice != packets->end()) {
        scene->rejected["packet that came twice"] += static_cast<std::size_t>(packets->end() - twice);
        packets->erase(twice, packets->end());
    }
}

const char* clock_name(unsigned kind)
{
    static const char* const names[] = {"unknown", "monotonic", "realtime", "TAI", "recording"};
    return kind < WIRE_CLOCK_COUNT ? names[kind] : "unknown";
}

Status add_cameras(const std::vector<Packet>& packets,
                   const std::map<std::uint64_t, std::string>& path_of_digest, Scene* scene)
{
    const wire_header& first = packets.front().header;
    for (const Packet& packet : packets) {
        const wire_header& header = packet.header;
        if (header.target_digest != 0 && path_of_digest.count(header.target_digest) == 0) {
            return Status::failure(fmt::format(
                "camera '{}' detected with target {:016x}, but the given target {} is {:016x}: give the "
                "file that the camera was started with",
                packet.camera, header.target_digest, path_of_digest.begin()->second,
                path_of_digest.begin()->first));
        }
        if (header.clock_kind != first.clock_kind) {
            return Status::failure(fmt::format(
                "the clocks of camera '{}' ({}) and camera '{}' ({}) cannot be compared: run all cameras "
                "on one kind of clock",
                packets.front().camera, clock_name(first.clock_kind), packet.camera,
                clock_name(header.clock_kind)));
        }
        if (scene->cameras.empty() || scene->cameras.back().name != packet.camera) {
            scene->cameras.push_back({packet.camera, header.width_px, header.height_px,
                                      static_cast<double>(header.row_time_ns)});
        } else if (static_cast<double>(header.row_time_ns) != scene->cameras.back().row_time_ns) {
            return Status::failure(fmt::format(
                "camera '{}' changed its row time from {} to {} ns: solve recordings of each apart",
                packet.camera, scene->cameras.back().row_time_ns, header.row_time_ns));
        } else if (scene->cameras.back().width_px != header.width_px
                   || scene->cameras.back().height_px != header.height_px) {
            return Status::failure(fmt::format(
                "camera '{}' changed its image size from {} x {} to {} x {}: solve each size apart",
                packet.camera, scene->cameras.back().width_px, scene->cameras.back().height_px,
                header.width_px, header.height_px));
        }
    }
    return Status();
}

// How much later than its instant's first each frame was captured.
void add_stamps(const std::vector<Capture>& captures, const std::vector<std::int64_t>& instants,
                Scene* scene)
{
    std::map<std::int64_t, std::int64_t> first_ns;
    for (std::size_t i = 0; i < captures.size(); ++i) {
        const auto [found, is_new] = first_ns.emplace(instants[i], captures[i].t_ns);
        found->second = std::min(found->second, captures[i].t_ns);
    }
    for (std::size_t i = 0; i < captures.size(); ++i) {
        scene->stamps_ns[{captures[i].camera, instants[i]}] = captures[i].t_ns - first_ns[instants[i]];
    }
}

}  // namespace

Result<Scene> observe(const std::vector<std::string>& journals,
                      const std::vector<std::string>& targets, const ObserveOptions& options)
{
    Scene scene;
    std::unordered_map<std::int64_t, std::size_t> board_of_point;
    std::map<std::uint64_t, std::string> path_of_digest;
    Status status = read_targets(targets, &scene, &board_of_point, &path_of_digest);
    std::vector<Packet> packets;
    for (std::size_t i = 0; i < journals.size() && status.ok(); ++i) {
        status = read_journal(journals[i], &scene, &packets);
        const Result<InputFile> input = digest_file(journals[i]);
        if (status.ok() && input.ok()) {
            scene.inputs.push_back(input.value());
        }
    }
    if (status.ok() && packets.empty()) {
        status = Status::failure(journals.front() + " holds no packets");
    }
    if (!status.ok()) {
        return status;
    }
    sort_packets(&scene, &packets);
    status = add_cameras(packets, path_of_digest, &scene);
    if (!status.ok()) {
        return status;
    }
    std::vector<Capture> captures;
    int camera = 0;
    for (const Packet& packet : packets) {
        camera += scene.cameras[static_cast<std::size_t>(camera)].name != packet.camera ? 1 : 0;
        captures.push_back({camera, packet.header.t_capture_ns});
    }
    const std::vector<std::int64_t> instants = find_instants(
        captures, options.tolerance_ns >= 0 ? options.tolerance_ns : default_tolerance_ns(captures));
    add_stamps(captures, instants, &scene);
    for (std::size_t i = 0; i < packets.size(); ++i) {
        for (const Sighting& seen : packets[i].sightings) {
            const auto found = board_of_point.find(seen.point);
            if (found == board_of_point.end()) {
                ++scene.rejected["patch on none of the targets"];
                continue;
            }
            const Board& board = scene.boards[found->second];
            scene.observations.push_back({captures[i].camera, static_cast<int>(found->second),
                                          instants[i], seen.pixel,
                                          static_cast<std::uint32_t>(board.index_of_id.at(seen.point)),
                                          static_cast<float>(seen.sigma_px)});
        }
    }
    sort_observations(&scene.observations);
    return scene;
}

}  // namespace rig
