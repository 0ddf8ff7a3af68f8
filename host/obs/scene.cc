// See scene.h.
#include "host/obs/scene.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "host/base/csv.h"
#include "host/obs/baselines.h"
#include "host/obs/digest.h"
#include "host/obs/observations_file.h"

namespace rig {
namespace {

using nlohmann::json;

constexpr int kSidePxMax = 100000;
constexpr double kRowTimeMaxNs = 1e6;  // a row a millisecond: slower than any camera that films

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
    const std::string odd =
        unknown_key(root, {"format", "version", "cameras", "boards", "rigid", "baselines"});
    if (!odd.empty()) {
        return Status::failure(path + ": unknown key '" + odd + "'");
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

// "row_time_ns" of a camera: a number, or "estimate". Negative where the image is upside down.
Status read_row_time(const json& entry, const std::string& where, SceneCamera* camera)
{
    const json value = entry.value("row_time_ns", json(0));
    camera->estimate_row_time = value == "estimate";
    if (camera->estimate_row_time) {
        return Status();
    }
    if (!value.is_number() || std::abs(value.get<double>()) > kRowTimeMaxNs) {
        return Status::failure(where + ": 'row_time_ns' must be \"estimate\" or a number of nanoseconds from "
                               "-1000000 to 1000000");
    }
    camera->row_time_ns = value;
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
        const std::string odd = unknown_key(entry, {"name", "width", "height", "row_time_ns"});
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
        const Status timed = read_row_time(entry, where, &cameras.back());
        if (!timed.ok()) {
            return timed;
        }
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
            board.scale = "the coordinates in " + std::filesystem::path(file).filename().string();
        }
        board.name = entry["name"];
        board.is_static = entry.value("static", false);
        board.group = static_cast<int>(boards.size());
        boards.push_back(std::move(board));
        Result<InputFile> digest = digest_file(file);
        if (!digest.ok()) {
            return digest.status();
        }
        scene->inputs.push_back(digest.value());
    }
    return boards;
}

// Boards that `rigid` fixes to each other get one group; what one of them is fixed to, all are:
// where one of a group is static, all stand still.
Status read_rigid(const json& root, const std::string& path, std::vector<Board>* boards)
{
    const json lists = root.value("rigid", json::array());
    const std::string where = path + ": key 'rigid' ";
    const auto shaped = [](const json& list) {
        return list.is_array() && list.size() >= 2
               && std::all_of(list.begin(), list.end(), [](const json& name) { return name.is_string(); });
    };
    if (!lists.is_array() || !std::all_of(lists.begin(), lists.end(), shaped)) {
        return Status::failure(where + "must be a list of lists of two or more board names");
    }
    for (const json& list : lists) {
        std::set<int> groups;
        for (const json& name : list) {
            const auto found = std::find_if(boards->begin(), boards->end(), [&](const Board& board) {
                return board.name == name.get<std::string>();
            });
            if (found == boards->end()) {
                return Status::failure(where + "names board '" + name.get<std::string>()
                                       + "', which is not in 'boards'");
            }
            groups.insert(found->group);
        }
        for (Board& board : *boards) {
            board.group = groups.count(board.group) != 0 ? *groups.begin() : board.group;
        }
    }
    for (const Board& fixed : *boards) {
        for (Board& board : *boards) {
            board.is_static = board.is_static || (fixed.is_static && board.group == fixed.group);
        }
    }
    return Status();
}

}  // namespace

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
    Result<InputFile> digest = digest_file(path);
    if (!digest.ok()) {
        return digest.status();
    }
    scene.inputs.push_back(digest.value());
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
    const Status joined = read_rigid(root.value(), path, &scene.boards);
    if (!joined.ok()) {
        return joined;
    }
    const Status known =
        read_baselines(root.value().value("baselines", json::array()), path, &scene);
    if (!known.ok()) {
        return known;
    }
    const Status read = read_observations(table, &scene);
    if (!read.ok()) {
        return read;
    }
    return scene;
}

}  // namespace rig
