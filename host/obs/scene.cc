// See scene.h.
#include "host/obs/scene.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <tuple>

#include "host/base/csv.h"

namespace rig {
namespace {

using nlohmann::json;

constexpr int kSidePxMax = 100000;

bool known_key(const std::string& key, const std::set<std::string>& known)
{
    return known.count(key) != 0 || key.rfind("x_", 0) == 0;
}

// The first key of `object` that nobody knows; empty when all are known.
std::string unknown_key(const json& object, const std::set<std::string>& known)
{
    for (const auto& item : object.items()) {
        if (!known_key(item.key(), known)) {
            return item.key();
        }
    }
    return {};
}

Result<json> read_json(const std::string& path)
{
    std::ifstream file(path);
    if (!file) {
        return Status::failure("cannot open " + path);
    }
    try {
        return json::parse(file);
    } catch (const json::exception& fault) {
        return Status::failure(path + " is not valid JSON: " + fault.what());
    }
}

Status check_head(const json& root, const std::string& path)
{
    if (!root.is_object() || root.value("format", json()) != "tessera-scene") {
        return Status::failure(path + ": key 'format' must be \"tessera-scene\"");
    }
    if (root.value("version", json()) != 1) {
        return Status::failure(path + ": key 'version' must be 1, the only one this program knows");
    }
    const std::string odd = unknown_key(root, {"format", "version", "cameras", "boards", "rigid"});
    if (!odd.empty()) {
        return Status::failure(path + ": unknown key '" + odd + "'");
    }
    if (root.contains("rigid") && !(root["rigid"].is_array() && root["rigid"].empty())) {
        return Status::failure(path + ": key 'rigid' is not supported yet; give boards that are fixed "
                                      "to each other as one board with a common points file");
    }
    for (const char* key : {"cameras", "boards"}) {
        if (!root.contains(key) || !root[key].is_array() || root[key].empty()) {
            return Status::failure(path + ": key '" + key + "' must be a list that is not empty");
        }
    }
    return Status();
}

Status check_name(const json& entry, const std::string& where, std::set<std::string>* taken)
{
    if (!entry.is_object() || !entry.contains("name") || !entry["name"].is_string()
        || entry["name"].get<std::string>().empty()) {
        return Status::failure(where + ": needs a 'name'");
    }
    const std::string name = entry["name"];
    if (name.find_first_of(",\n\r/") != std::string::npos) {
        return Status::failure(where + ": name '" + name + "' may hold no comma, slash or line end");
    }
    if (!taken->insert(name).second) {
        return Status::failure(where + ": name '" + name + "' stands twice");
    }
    return Status();
}

Result<std::vector<SceneCamera>> read_cameras(const json& list, const std::string& path)
{
    std::vector<SceneCamera> cameras;
    std::set<std::string> names;
    for (const json& entry : list) {
        const std::string where = path + ": cameras[" + std::to_string(cameras.size()) + "]";
        const Status named = check_name(entry, where, &names);
        if (!named.ok()) {
            return named;
        }
        const std::string odd = unknown_key(entry, {"name", "width", "height"});
        if (!odd.empty()) {
            return Status::failure(where + ": unknown key '" + odd + "'");
        }
        for (const char* key : {"width", "height"}) {
            if (!entry.contains(key) || !entry[key].is_number_integer() || entry[key] < 1
                || entry[key] > kSidePxMax) {
                return Status::failure(where + ": '" + key + "' must be an integer from 1 to "
                                       + std::to_string(kSidePxMax));
            }
        }
        cameras.push_back({entry["name"], entry["width"], entry["height"]});
    }
    return cameras;
}

Status read_points(const std::string& path, Board* board)
{
    std::ifstream file(path);
    if (!file) {
        return Status::failure("cannot open " + path);
    }
    CsvReader csv(file, path);
    const Status header = csv.header({"point", "x", "y", "z"}, {"radius"});
    if (!header.ok()) {
        return header;
    }
    while (csv.next()) {
        BoardPoint point;
        if (!csv.integer(0, &point.id) || !csv.number(1, &point.at_mm.x())
            || !csv.number(2, &point.at_mm.y()) || !csv.number(3, &point.at_mm.z())
            || (!csv.cell(4).empty() && !csv.number(4, &point.radius_mm))) {
            return csv.status();
        }
        if (point.radius_mm < 0.0) {
            return csv.complain("radius must not be negative");
        }
        if (point.radius_mm > 0.0 && point.at_mm.z() != 0.0) {
            return csv.complain("a circle must lie in the plane z = 0");
        }
        if (!board->index_of_id.emplace(point.id, board->points.size()).second) {
            return csv.complain("point " + std::to_string(point.id) + " stands twice");
        }
        board->points.push_back(point);
    }
    if (csv.status().ok() && board->points.empty()) {
        return Status::failure(path + " holds no points");
    }
    return csv.status();
}

Result<std::vector<Board>> read_boards(const json& list, const std::string& path, Scene* scene)
{
    std::vector<Board> boards;
    std::set<std::string> names;
    const std::filesystem::path folder = std::filesystem::path(path).parent_path();
    for (const json& entry : list) {
        const std::string where = path + ": boards[" + std::to_string(boards.size()) + "]";
        const Status named = check_name(entry, where, &names);
        if (!named.ok()) {
            return named;
        }
        const std::string odd = unknown_key(entry, {"name", "target", "points", "static"});
        if (!odd.empty()) {
            return Status::failure(where + ": unknown key '" + odd + "'");
        }
        const bool is_target = entry.contains("target");
        const char* key = is_target ? "target" : "points";
        if (is_target == entry.contains("points") || !entry[key].is_string()) {
            return Status::failure(where + ": needs either 'target' or 'points', a file's name");
        }
        if (entry.contains("static") && !entry["static"].is_boolean()) {
            return Status::failure(where + ": 'static' must be true or false");
        }
        const std::string file = (folder / entry[key].get<std::string>()).string();
        Board board;
        if (is_target) {
            Result<Board> read = read_target_board(file, nullptr);
            if (!read.ok()) {
                return read.status();
            }
            board = std::move(read.value());
        } else {
            const Status read = read_points(file, &board);
            if (!read.ok()) {
                return read;
            }
        }
        board.name = entry["name"];
        board.is_static = entry.value("static", false);
        boards.push_back(std::move(board));
        Result<InputFile> digest = digest_file(file);
        if (!digest.ok()) {
            return digest.status();
        }
        scene->inputs.push_back(digest.value());
    }
    return boards;
}

// The index that a cell means: a name, or else a number below the count; -1 when it is neither.
int find_named(std::string_view cell, const std::unordered_map<std::string, int>& index_of_name)
{
    const auto found = index_of_name.find(std::string(cell));
    if (found != index_of_name.end()) {
        return found->second;
    }
    int index = -1;
    const auto [end, fault] = std::from_chars(cell.data(), cell.data() + cell.size(), index);
    const bool whole = fault == std::errc() && end == cell.data() + cell.size();
    return whole && index >= 0 && index < static_cast<int>(index_of_name.size()) ? index : -1;
}

template <typename Named>
std::unordered_map<std::string, int> index_by_name(const std::vector<Named>& list)
{
    std::unordered_map<std::string, int> index_of_name;
    for (const Named& entry : list) {
        index_of_name.emplace(entry.name, static_cast<int>(index_of_name.size()));
    }
    return index_of_name;
}

struct Row {
    Observation observation;
    std::int64_t line;
};

auto order_key(const Observation& o)
{
    return std::make_tuple(o.camera, o.frame, o.board, o.point);
}

Status read_row(CsvReader* csv, const Scene& scene,
                const std::unordered_map<std::string, int>& cameras,
                const std::unordered_map<std::string, int>& boards, Observation* out)
{
    out->camera = find_named(csv->cell(0), cameras);
    if (out->camera < 0) {
        return csv->complain("camera '" + std::string(csv->cell(0)) + "' is not in scene.json");
    }
    out->board = find_named(csv->cell(2), boards);
    if (out->board < 0) {
        return csv->complain("board '" + std::string(csv->cell(2)) + "' is not in scene.json");
    }
    std::int64_t point = 0;
    if (!csv->integer(1, &out->frame) || !csv->integer(3, &point)
        || !csv->number(4, &out->pixel.x()) || !csv->number(5, &out->pixel.y())) {
        return csv->status();
    }
    const Board& board = scene.boards[static_cast<std::size_t>(out->board)];
    const auto found = board.index_of_id.find(point);
    if (found == board.index_of_id.end()) {
        return csv->complain("board '" + board.name + "' has no point " + std::to_string(point));
    }
    out->point = found->second;
    if (!csv->cell(6).empty()) {
        if (!csv->number(6, &out->sigma_px)) {
            return csv->status();
        }
        if (!(out->sigma_px > 0.0)) {
            return csv->complain("sigma must be above 0");
        }
    }
    return Status();
}

Status read_observations(const std::string& path, Scene* scene)
{
    std::ifstream file(path);
    if (!file) {
        return Status::failure("cannot open " + path);
    }
    CsvReader csv(file, path);
    const Status header = csv.header({"camera", "frame", "board", "point", "x", "y"}, {"sigma"});
    if (!header.ok()) {
        return header;
    }
    const auto cameras = index_by_name(scene->cameras);
    const auto boards = index_by_name(scene->boards);
    std::vector<Row> rows;
    while (csv.next()) {
        Row row{{}, csv.line()};
        const Status read = read_row(&csv, *scene, cameras, boards, &row.observation);
        if (!read.ok()) {
            return read;
        }
        rows.push_back(row);
    }
    if (!csv.status().ok()) {
        return csv.status();
    }
    if (rows.empty()) {
        return Status::failure(path + " holds no observations");
    }
    std::stable_sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) {
        return order_key(a.observation) < order_key(b.observation);
    });
    for (std::size_t i = 1; i < rows.size(); ++i) {
        const Observation& o = rows[i].observation;
        if (order_key(rows[i - 1].observation) == order_key(o)) {
            const Board& board = scene->boards[static_cast<std::size_t>(o.board)];
            return Status::failure(
                path + " line " + std::to_string(rows[i].line) + ": observes point "
                + std::to_string(board.points[o.point].id) + " of board '" + board.name
                + "' with camera '" + scene->cameras[static_cast<std::size_t>(o.camera)].name
                + "' in frame " + std::to_string(o.frame) + " a second time, after line "
                + std::to_string(rows[i - 1].line));
        }
    }
    scene->observations.reserve(rows.size());
    for (const Row& row : rows) {
        scene->observations.push_back(row.observation);
    }
    return Status();
}

}  // namespace

void sort_observations(std::vector<Observation>* observations)
{
    std::stable_sort(observations->begin(), observations->end(),
                     [](const Observation& a, const Observation& b) {
                         return order_key(a) < order_key(b);
                     });
}

Result<InputFile> digest_file(const std::string& path)
{
    std::ifstream file(path, std::ios::binary);
    if (!file) {
        return Status::failure("cannot open " + path);
    }
    std::uint64_t hash = 0xcbf29ce484222325u;
    std::vector<char> buffer(1 << 16);
    while (file.read(buffer.data(), static_cast<std::streamsize>(buffer.size())) || file.gcount() > 0) {
        for (std::streamsize i = 0; i < file.gcount(); ++i) {
            hash ^= static_cast<unsigned char>(buffer[static_cast<std::size_t>(i)]);
            hash *= 0x100000001b3u;
        }
    }
    if (file.bad()) {
        return Status::failure("cannot read " + path);
    }
    static const char digits[] = "0123456789abcdef";
    std::string text(16, '0');
    for (std::size_t i = 0; i < text.size(); ++i) {
        text[i] = digits[(hash >> (60 - 4 * i)) & 15u];
    }
    return InputFile{path, text};
}

Result<Scene> read_scene(const std::string& folder)
{
    const std::string path = (std::filesystem::path(folder) / "scene.json").string();
    const std::string table = (std::filesystem::path(folder) / "observations.csv").string();
    Result<json> root = read_json(path);
    if (!root.ok()) {
        return root.status();
    }
    const Status head = check_head(root.value(), path);
    if (!head.ok()) {
        return head;
    }
    Scene scene;
    for (const std::string& file : {path, table}) {
        Result<InputFile> digest = digest_file(file);
        if (!digest.ok()) {
            return digest.status();
        }
        scene.inputs.push_back(digest.value());
    }
    Result<std::vector<SceneCamera>> cameras = read_cameras(root.value()["cameras"], path);
    if (!cameras.ok()) {
        return cameras.status();
    }
    scene.cameras = std::move(cameras.value());
    Result<std::vector<Board>> boards = read_boards(root.value()["boards"], path, &scene);
    if (!boards.ok()) {
        return boards.status();
    }
    scene.boards = std::move(boards.value());
    const Status read = read_observations(table, &scene);
    if (!read.ok()) {
        return read;
    }
    return scene;
}

}  // namespace rig
