// See summary.h.
#include "host/report/summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "host/report/choice_report.h"
#include "host/report/shutter_json.h"

namespace rig {
namespace {

using nlohmann::ordered_json;

// Above these a parameter is worth a word: a focal length known to a thousandth, a position to a
// millimetre, a rotation to a hundredth of a degree.
constexpr double kFocalWeakPart = 0.001;
constexpr double kPositionWeakMm = 1.0;
constexpr double kRotationWeakDeg = 0.01;
constexpr double kRejectedWeakPart = 0.05;
constexpr double kNoiseFactorWeak = 1.5;

// Below these the views themselves are wanting: a focal length and the distance are told apart by the
// depth that a tilt or a change of distance brings, and two cameras by what both see at once.
constexpr double kTiltMostDeg = 30.0;
constexpr double kDistanceRatio = 1.3;
constexpr std::int64_t kSharedMin = 5;

constexpr std::size_t kSharedNamed = 4;  // in one row of a table

using Out = std::back_insert_iterator<std::string>;

double norm(const ordered_json& list)
{
    double sum = 0.0;
    for (const ordered_json& item : list) {
        sum += item.get<double>() * item.get<double>();
    }
    return std::sqrt(sum);
}

void table_row(const std::string& name, const ordered_json& row, const std::string& rest, Out out)
{
    fmt::format_to(out, "{:<16} {:>9.4f} {:>9.4f} {:>9.4f} {:>9.4f} {:>9.3f} {:>9} {:>8} {}\n", name,
                   row.at("rmse_px").get<double>(), row.at("mean_px").get<double>(),
                   row.at("std_px").get<double>(), row.at("rmse_all_px").get<double>(),
                   row.at("whitened_rms").get<double>(), row.at("observations").get<std::int64_t>(),
                   row.at("rejected").get<std::int64_t>(), rest);
}

void table(const ordered_json& rig, Out out)
{
    fmt::format_to(out, "Reprojection error in pixels (length of the residual; all: rejected points too) and, "
                        "whitened,\nover its sigma per axis: 1 where the sigmas are honest\n");
    fmt::format_to(out, "{:<16} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>8} {:>6} {:>13} {:>9}\n", "camera",
                   "RMSE", "mean", "std", "RMSE all", "whitened", "points", "rejected", "views", "points/frame",
                   "coverage");
    for (const ordered_json& camera : rig.at("cameras")) {
        table_row(camera.at("name"), camera,
                  fmt::format("{:>6} {:>13.1f} {:>7.0f} %", camera.at("views").get<std::int64_t>(),
                              camera.at("points_per_frame").get<double>(),
                              100.0 * camera.at("coverage").at("part").get<double>()),
                  out);
    }
    table_row("rig", rig, "", out);
}

// Two lines a camera: what it is, and its distortion.
void lens(const ordered_json& camera, Out out)
{
    const ordered_json& deviation = camera.at("standard_deviation");
    const ordered_json& t = camera.at("cam_from_rig").at("translation_mm");
    fmt::format_to(out, "{:<16} {:>10.3f} {:>10.3f} {:>8.3f} {:>10.3f} {:>10.3f} {:>8.3f} {:>9.2f} {:>9.2f} "
                        "{:>9.2f} {:>7.3f} {:>8.4f}\n",
                   camera.at("name").get<std::string>(), camera.at("fx").get<double>(),
                   camera.at("fy").get<double>(), deviation.at("fx").get<double>(),
                   camera.at("cx").get<double>(), camera.at("cy").get<double>(),
                   deviation.at("cx").get<double>(), t.at(0).get<double>(), t.at(1).get<double>(),
                   t.at(2).get<double>(), norm(deviation.at("translation_mm")),
                   norm(deviation.at("rotation_deg")));
    fmt::format_to(out, "    {}", camera.at("model").get<std::string>());
    for (const ordered_json& value : camera.at("distortion")) {
        fmt::format_to(out, " {:.6g}", value.get<double>());
    }
    fmt::format_to(out, "\n");
}

void lenses(const ordered_json& rig, Out out)
{
    fmt::format_to(out, "\nLenses (px) and the rig's origin in each camera (mm), with standard deviations; "
                        "turn in degrees\n{:<16} {:>10} {:>10} {:>8} {:>10} {:>10} {:>8} {:>9} {:>9} {:>9} "
                        "{:>7} {:>8}\n",
                   "camera", "fx", "fy", "+-", "cx", "cy", "+-", "x", "y", "z", "+-", "turn +-");
    for (const ordered_json& camera : rig.at("cameras")) {
        lens(camera, out);
    }
}

// How the boards were held.
void views(const ordered_json& rig, Out out)
{
    fmt::format_to(out, "\nViews: distance of points (mm), tilt of the board (degrees), how often it faced "
                        "where, and with whom\n{:<16} {:>6} {:>6} {:>6} {:>5} {:>5} {:>5} {:>5} {:>5} {:>5}  {}\n",
                   "camera", "least", "median", "most", "tilt", "most", "left", "right", "up", "down",
                   "views shared with");
    for (const ordered_json& camera : rig.at("cameras")) {
        const ordered_json& distance = camera.at("distance_mm");
        const ordered_json& tilt = camera.at("tilt_deg");
        const ordered_json& tilted = camera.at("tilted_views");
        std::string shared;
        std::size_t named = 0;
        for (const auto& item : camera.at("shared_views").items()) {
            if (named++ < kSharedNamed) {
                shared += fmt::format("{}{} {}", shared.empty() ? "" : ", ", item.key(),
                                      item.value().get<std::int64_t>());
            }
        }
        shared += named > kSharedNamed ? fmt::format(" and {} more", named - kSharedNamed) : "";
        fmt::format_to(out, "{:<16} {:>6.0f} {:>6.0f} {:>6.0f} {:>5.0f} {:>5.0f} {:>5} {:>5} {:>5} {:>5}  {}\n",
                       camera.at("name").get<std::string>(), distance.at("least").get<double>(),
                       distance.at("median").get<double>(), distance.at("most").get<double>(),
                       tilt.at("median").get<double>(), tilt.at("most").get<double>(),
                       tilted.at("left").get<std::int64_t>(), tilted.at("right").get<std::int64_t>(),
                       tilted.at("up").get<std::int64_t>(), tilted.at("down").get<std::int64_t>(), shared);
    }
}

// Which length sets the scale, by board. A flat board alone does not tell whether all images are mirrored.
void scale(const ordered_json& rig, Out out)
{
    fmt::format_to(out, "\nScale\n");
    for (const ordered_json& board : rig.at("boards")) {
        const bool from_behind = board.value("seen_from", ordered_json()) == "+z";
        fmt::format_to(out, "    {}: {}{}\n", board.at("name").get<std::string>(),
                       board.at("scale").get<std::string>(),
                       from_behind ? "; seen from its +z side in all views: mirrored, unless its z axis points to "
                                     "the viewer"
                                   : "");
    }
}

// What a person should look at; empty when there is nothing.
std::string weak_spots(const ordered_json& rig)
{
    std::string text;
    const auto out = std::back_inserter(text);
    for (const ordered_json& sentence : rig.at("left_out")) {
        fmt::format_to(out, "- left out: {}\n", sentence.get<std::string>());
    }
    const std::string held_out = choice_warning(rig);
    if (!held_out.empty()) {
        fmt::format_to(out, "- {}\n", held_out);
    }
    for (const ordered_json& camera : rig.at("cameras")) {
        const std::string name = camera.at("name");
        const ordered_json& deviation = camera.at("standard_deviation");
        const double focal = deviation.at("fx").get<double>() / std::abs(camera.at("fx").get<double>());
        if (focal > kFocalWeakPart) {
            fmt::format_to(out, "- {}: focal length known to {:.2f} % only; add views tilted by 20 to 45 "
                                "degrees\n", name, 100.0 * focal);
        }
        if (norm(deviation.at("translation_mm")) > kPositionWeakMm
            || norm(deviation.at("rotation_deg")) > kRotationWeakDeg) {
            fmt::format_to(out, "- {}: pose in the rig known to {:.2f} mm and {:.4f} degrees only; add "
                                "frames that it shares with other cameras\n", name,
                           norm(deviation.at("translation_mm")), norm(deviation.at("rotation_deg")));
        }
        const auto used = camera.at("observations").get<double>();
        const auto rejected = camera.at("rejected").get<double>();
        if (rejected > kRejectedWeakPart * (used + rejected)) {
            fmt::format_to(out, "- {}: {:.0f} % of its points do not fit the rig\n", name,
                           100.0 * rejected / (used + rejected));
        }
        const double factor = camera.at("noise_factor");
        if (factor > kNoiseFactorWeak) {
            fmt::format_to(out, "- {}: residuals are {:.1f} times what the points' sigmas say: the lens "
                                "model or the board's shape does not fit; try a richer --model{}\n",
                           name, factor,
                           rig.contains("motion") ? "" : ", or give row times where boards moved while "
                                                         "rolling shutters read them");
        }
    }
    return text;
}

void add(const std::string& what, std::string* list)
{
    *list += (list->empty() ? "" : "; ") + what;
}

// Views that this camera lacks; empty when it lacks none.
std::string lacking(const ordered_json& camera, bool alone)
{
    std::string text;
    std::string areas;
    for (const ordered_json& area : camera.at("coverage").at("weak")) {
        areas += (areas.empty() ? "" : ", ") + area.get<std::string>();
    }
    if (!areas.empty()) {
        add("the board in the image's " + areas, &text);
    }
    const double tilt = camera.at("tilt_deg").at("most");
    std::string missing;
    int count = 0;
    for (const auto& item : camera.at("tilted_views").items()) {
        if (item.value().get<std::int64_t>() == 0) {
            missing += (missing.empty() ? "" : ", ") + item.key();
            ++count;
        }
    }
    if (tilt < kTiltMostDeg) {
        add(fmt::format("the board tilted by 30 to 45 degrees ({:.0f} at most now)", tilt), &text);
    } else if (count >= 2) {
        add("the board tilted to face " + missing, &text);
    }
    const double least = camera.at("distance_mm").at("least");
    const double most = camera.at("distance_mm").at("most");
    if (most < kDistanceRatio * least) {
        add(fmt::format("the board nearer and farther than {:.0f} to {:.0f} mm", least, most), &text);
    }
    std::int64_t shared = 0;
    for (const auto& item : camera.at("shared_views").items()) {
        shared = std::max(shared, item.value().get<std::int64_t>());
    }
    if (!alone && shared < kSharedMin) {
        add(fmt::format("more instants shared with another camera ({} at most now)", shared), &text);
    }
    return text;
}

void advice(const ordered_json& rig, Out out)
{
    const ordered_json& cameras = rig.at("cameras");
    std::string good;
    std::string lack;
    const std::string weak = weak_spots(rig);
    for (const ordered_json& camera : cameras) {
        const std::string name = camera.at("name");
        const std::string own = lacking(camera, cameras.size() == 1);
        if (!own.empty()) {
            lack += "- " + name + ": " + own + "\n";
        } else if (weak.find("- " + name + ":") == std::string::npos) {
            good += (good.empty() ? "" : ", ") + name;
        }
    }
    fmt::format_to(out, "\nGood: {}\n", good.empty() ? "no camera in every respect" : good);
    fmt::format_to(out, "Weak spots{}\n{}", weak.empty() ? ": none found" : "", weak);
    fmt::format_to(out, "Views to add{}\n{}", lack.empty() ? ": none needed" : "", lack);
}

}  // namespace

Result<std::string> summary_text(const ordered_json& rig, const std::string& source)
{
    try {
        std::string text;
        const auto out = std::back_inserter(text);
        table(rig, out);
        fmt::format_to(out, "\nRejected observations{}\n",
                       rig.at("rejected_by_reason").empty() ? ": none" : "");
        for (const auto& item : rig.at("rejected_by_reason").items()) {
            fmt::format_to(out, "    {:>9}  {}\n", item.value().get<std::int64_t>(), item.key());
        }
        lenses(rig, out);
        const std::string models = choice_text(rig);
        if (!models.empty()) {
            text += "\nModels\n" + models;
        }
        const std::string shutters = shutter_text(rig);
        if (!shutters.empty()) {
            text += "\nRolling shutters\n" + shutters;
        }
        views(rig, out);
        scale(rig, out);
        advice(rig, out);
        return text;
    } catch (const ordered_json::exception& fault) {
        return Status::failure(source + " lacks what the summary needs: " + fault.what());
    }
}

}  // namespace rig
