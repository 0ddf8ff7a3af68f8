// See summary.h.
#include "host/report/summary.h"

#include <fmt/format.h>

#include <cmath>
#include <iterator>

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
    fmt::format_to(out, "{:<16} {:>9.4f} {:>9.4f} {:>9.4f} {:>9.4f} {:>9} {:>8} {}\n", name,
                   row.at("rmse_px").get<double>(), row.at("mean_px").get<double>(),
                   row.at("std_px").get<double>(), row.at("rmse_all_px").get<double>(),
                   row.at("observations").get<std::int64_t>(), row.at("rejected").get<std::int64_t>(),
                   rest);
}

void table(const ordered_json& rig, Out out)
{
    fmt::format_to(out, "Reprojection error in pixels (length of the residual)\n\n");
    fmt::format_to(out, "{:<16} {:>9} {:>9} {:>9} {:>9} {:>9} {:>8} {:>6} {:>13} {:>9}\n", "camera", "RMSE",
                   "mean", "std", "RMSE all", "points", "rejected", "views", "points/frame", "coverage");
    for (const ordered_json& camera : rig.at("cameras")) {
        table_row(camera.at("name"), camera,
                  fmt::format("{:>6} {:>13.1f} {:>7.0f} %", camera.at("views").get<std::int64_t>(),
                              camera.at("points_per_frame").get<double>(),
                              100.0 * camera.at("coverage").at("part").get<double>()),
                  out);
    }
    table_row("rig", rig, "", out);
}

void parameter(const char* name, double value, double deviation, Out out)
{
    fmt::format_to(out, "    {:<4} {:>14.6f}  +- {:.6f}\n", name, value, deviation);
}

void lens(const ordered_json& camera, Out out)
{
    const ordered_json& deviation = camera.at("standard_deviation");
    fmt::format_to(out, "\n{} ({} x {}, {})\n", camera.at("name").get<std::string>(),
                   camera.at("width").get<int>(), camera.at("height").get<int>(),
                   camera.at("model").get<std::string>());
    for (const char* name : {"fx", "fy", "cx", "cy"}) {
        parameter(name, camera.at(name), deviation.at(name), out);
    }
    const bool fisheye = camera.at("model") == "fisheye";
    static const char* const usual[] = {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6",
                                        "s1", "s2", "s3", "s4"};
    static const char* const theta[] = {"k1", "k2", "k3", "k4"};
    const ordered_json& distortion = camera.at("distortion");
    for (std::size_t i = 0; i < distortion.size() && i < std::size(usual); ++i) {
        parameter(fisheye ? theta[i % 4] : usual[i], distortion[i], deviation.at("distortion").at(i), out);
    }
    const ordered_json& t = camera.at("cam_from_rig").at("translation_mm");
    const ordered_json& dt = deviation.at("translation_mm");
    const ordered_json& dr = deviation.at("rotation_deg");
    fmt::format_to(out, "    rig's origin in this camera  {:.4f} {:.4f} {:.4f} mm  +- {:.4f} {:.4f} {:.4f}\n",
                   t.at(0).get<double>(), t.at(1).get<double>(), t.at(2).get<double>(),
                   dt.at(0).get<double>(), dt.at(1).get<double>(), dt.at(2).get<double>());
    fmt::format_to(out, "    rotation about its axes      +- {:.5f} {:.5f} {:.5f} degrees\n",
                   dr.at(0).get<double>(), dr.at(1).get<double>(), dr.at(2).get<double>());
}

// What a person should look at; empty when there is nothing.
std::string weak_spots(const ordered_json& rig)
{
    std::string text;
    const auto out = std::back_inserter(text);
    for (const ordered_json& sentence : rig.at("left_out")) {
        fmt::format_to(out, "- left out: {}\n", sentence.get<std::string>());
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
        std::string areas;
        for (const ordered_json& area : camera.at("coverage").at("weak")) {
            areas += (areas.empty() ? "" : ", ") + area.get<std::string>();
        }
        if (!areas.empty()) {
            fmt::format_to(out, "- {}: few points in the image's {}; hold the board there\n", name, areas);
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
                                "model or the board's shape does not fit; try a richer --model\n",
                           name, factor);
        }
    }
    return text;
}

}  // namespace

Result<std::string> summary_text(const ordered_json& rig, const std::string& source)
{
    try {
        std::string text;
        const auto out = std::back_inserter(text);
        table(rig, out);
        fmt::format_to(out, "\nRejected observations\n");
        for (const auto& item : rig.at("rejected_by_reason").items()) {
            fmt::format_to(out, "    {:>9}  {}\n", item.value().get<std::int64_t>(), item.key());
        }
        if (rig.at("rejected_by_reason").empty()) {
            text += "    none\n";
        }
        text += "\nCameras, with standard deviations\n";
        for (const ordered_json& camera : rig.at("cameras")) {
            lens(camera, out);
        }
        const std::string weak = weak_spots(rig);
        text += "\nWeak spots\n" + (weak.empty() ? "none found\n" : weak);
        return text;
    } catch (const ordered_json::exception& fault) {
        return Status::failure(source + " lacks what the summary needs: " + fault.what());
    }
}

}  // namespace rig
