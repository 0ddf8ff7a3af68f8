// See observations_file.h.
#include "host/obs/observations_file.h"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <tuple>

#include "host/base/csv.h"
#include "host/obs/digest.h"

namespace rig {
namespace {

auto order_key(const Observation& o)
{
    return std::make_tuple(o.camera, o.frame, o.board, o.point);
}

bool in_order(const Observation& a, const Observation& b)
{
    return order_key(a) < order_key(b);
}

// Names or numbers of cameras or boards. Files repeat the same cell for long: the last answer is
// kept.
class Names {
public:
    template <typename Named>
    explicit Names(const std::vector<Named>& list)
    {
        for (const Named& entry : list) {
            index_of_name_.emplace(entry.name, static_cast<int>(index_of_name_.size()));
        }
    }
    // The index that a cell means: a name, or else a number below the count; -1 when it is neither.
    int find(std::string_view cell)
    {
        if (cell != last_cell_ || last_ < 0) {
            last_cell_ = std::string(cell);
            last_ = look_up(last_cell_);
        }
        return last_;
    }

private:
    int look_up(const std::string& cell) const
    {
        const auto found = index_of_name_.find(cell);
        if (found != index_of_name_.end()) {
            return found->second;
        }
        int index = -1;
        const auto [end, fault] = std::from_chars(cell.data(), cell.data() + cell.size(), index);
        const bool whole = fault == std::errc() && end == cell.data() + cell.size();
        return whole && index >= 0 && index < static_cast<int>(index_of_name_.size()) ? index : -1;
    }
    std::unordered_map<std::string, int> index_of_name_;
    std::string last_cell_;
    int last_ = -1;
};

class Rows {
public:
    Rows(std::string_view text, const std::string& path, const Scene& scene)
        : scene_(scene), csv_(text, path), cameras_(scene.cameras), boards_(scene.boards)
    {
    }
    Status header() { return csv_.header({"camera", "frame", "board", "point", "x", "y"}, {"sigma"}); }
    // False at the end and after a fault, which status() then tells.
    bool next(Observation* out)
    {
        if (!csv_.next()) {
            status_ = csv_.status();
            return false;
        }
        status_ = read(out);
        return status_.ok();
    }
    const Status& status() const { return status_; }
    const CsvReader& csv() const { return csv_; }

private:
    Status read(Observation* out)
    {
        out->camera = cameras_.find(csv_.cell(0));
        if (out->camera < 0) {
            return csv_.complain("camera '" + std::string(csv_.cell(0)) + "' is not in scene.json");
        }
        out->board = boards_.find(csv_.cell(2));
        if (out->board < 0) {
            return csv_.complain("board '" + std::string(csv_.cell(2)) + "' is not in scene.json");
        }
        std::int64_t point = 0;
        if (!csv_.integer(1, &out->frame) || !csv_.integer(3, &point)
            || !csv_.number(4, &out->pixel.x()) || !csv_.number(5, &out->pixel.y())) {
            return csv_.status();
        }
        const Board& board = scene_.boards[static_cast<std::size_t>(out->board)];
        const auto found = board.index_of_id.find(point);
        if (found == board.index_of_id.end()) {
            return csv_.complain("board '" + board.name + "' has no point " + std::to_string(point));
        }
        out->point = static_cast<std::uint32_t>(found->second);
        out->sigma_px = 0.0f;
        if (!csv_.cell(6).empty()) {
            double sigma_px = 0.0;
            if (!csv_.number(6, &sigma_px)) {
                return csv_.status();
            }
            if (!(sigma_px > 0.0)) {
                return csv_.complain("sigma must be above 0");
            }
            out->sigma_px = static_cast<float>(sigma_px);
        }
        return Status();
    }

    const Scene& scene_;
    CsvReader csv_;
    Names cameras_;
    Names boards_;
    Status status_;
};

// The sentence about an observation that stands twice: the file is read again for its lines.
Status stands_twice(std::string_view text, const std::string& path, const Scene& scene,
                    const Observation& twice)
{
    Rows rows(text, path, scene);
    Status status = rows.header();
    Observation row;
    std::int64_t first = 0;
    while (status.ok() && rows.next(&row)) {
        if (order_key(row) != order_key(twice)) {
            continue;
        }
        if (first == 0) {
            first = rows.csv().line();
            continue;
        }
        const Board& board = scene.boards[static_cast<std::size_t>(row.board)];
        return rows.csv().complain(
            "observes point " + std::to_string(board.points[row.point].id) + " of board '" + board.name
            + "' with camera '" + scene.cameras[static_cast<std::size_t>(row.camera)].name + "' in frame "
            + std::to_string(row.frame) + " a second time, after line " + std::to_string(first)
            + "; remove one of them");
    }
    return status.ok() ? rows.status() : status;
}

}  // namespace

void sort_observations(std::vector<Observation>* observations)
{
    if (!std::is_sorted(observations->begin(), observations->end(), in_order)) {
        std::stable_sort(observations->begin(), observations->end(), in_order);
    }
}

Status read_observations(const std::string& path, Scene* scene)
{
    std::string text;
    std::ifstream file(path, std::ios::binary | std::ios::ate);
    if (file) {
        text.resize(static_cast<std::size_t>(std::max<std::streamoff>(0, file.tellg())));
        file.seekg(0);
        file.read(text.data(), static_cast<std::streamsize>(text.size()));
    }
    if (!file) {
        return Status::failure("cannot open " + path);
    }
    Digest digest;
    digest.add(text);
    scene->inputs.push_back({path, digest.text()});
    Rows rows(text, path, *scene);
    const Status header = rows.header();
    if (!header.ok()) {
        return header;
    }
    const auto lines = static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
    std::vector<Observation>& out = scene->observations;
    out.reserve(lines);
    Observation row;
    while (rows.next(&row)) {
        out.push_back(row);
    }
    if (!rows.status().ok()) {
        return rows.status();
    }
    if (out.empty()) {
        return Status::failure(path + " holds no observations");
    }
    sort_observations(&out);
    const auto twice = std::adjacent_find(out.begin(), out.end(), [](const auto& a, const auto& b) {
        return order_key(a) == order_key(b);
    });
    return twice == out.end() ? Status() : stands_twice(text, path, *scene, *twice);
}

}  // namespace rig
