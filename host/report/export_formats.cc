// See export_formats.h. Texts are written here, number by number, because each is a page long and every
// reader has its own idea of YAML: numbers always have a point (PyYAML takes 1e-05 for a word).
#include "host/report/export_formats.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <iterator>

#include "host/report/export.h"
#include "host/report/export_opencv.h"
#include "host/report/nearest_lens.h"

namespace rig {
namespace {

constexpr double kMetresPerMm = 1e-3;

// What a format can say about lenses: how many coefficients, of OpenCV's order and of a fisheye's.
struct Format {
    std::string name;
    std::vector<int> counts;
    bool fisheye;
};

const std::vector<Format>& formats()
{
    static const std::vector<Format> all{{"opencv", {5, 8, 12}, true}, {"ros", {5, 8}, true},
                                         {"kalibr", {4}, true},           {"colmap", {4, 8}, true},
                                         {"mrcal", {5, 8, 12}, false},    {"json", {12}, true}};
    return all;
}

// A camera with a lens that the format can carry; `count` of its coefficients.
struct Carried {
    RigCamera camera;
    std::size_t count = 0;
    std::vector<double> distortion() const
    {
        const auto begin = camera.lens.intrinsics.begin() + kPinholeCount;
        return {begin, begin + static_cast<std::ptrdiff_t>(count)};
    }
    bool fisheye() const { return camera.lens.model == CameraModel::kFisheye; }
};

std::string number(double value)
{
    std::string text = fmt::format("{}", value);
    if (text.find('.') == std::string::npos) {
        text.insert(std::min(text.find('e'), text.size()), ".0");
    }
    return text;
}

std::string numbers(const std::vector<double>& values)
{
    std::string text;
    for (const double value : values) {
        text += (text.empty() ? "" : ", ") + number(value);
    }
    return "[" + text + "]";
}

// In double quotes, as JSON and YAML both read it.
std::string quoted(const std::string& text)
{
    return nlohmann::json(text).dump();
}

std::string opencv_text(const std::vector<Carried>& cameras)
{
    RigFile rig;
    for (const Carried& carried : cameras) {
        rig.cameras.push_back(carried.camera);
    }
    return opencv_yaml(rig);
}

std::vector<NamedText> ros_files(const std::vector<Carried>& cameras)
{
    std::vector<NamedText> out;
    for (const Carried& carried : cameras) {
        const std::vector<double>& k = carried.camera.lens.intrinsics;
        const char* model =
            carried.fisheye() ? "equidistant" : carried.count == 5 ? "plumb_bob" : "rational_polynomial";
        out.push_back(
            {carried.camera.name + ".yaml",
             fmt::format("image_width: {}\nimage_height: {}\ncamera_name: {}\n"
                         "camera_matrix:\n  rows: 3\n  cols: 3\n  data: {}\n"
                         "distortion_model: {}\n"
                         "distortion_coefficients:\n  rows: 1\n  cols: {}\n  data: {}\n"
                         "rectification_matrix:\n  rows: 3\n  cols: 3\n  data: {}\n"
                         "projection_matrix:\n  rows: 3\n  cols: 4\n  data: {}\n",
                         carried.camera.width_px, carried.camera.height_px, quoted(carried.camera.name),
                         numbers({k[0], 0, k[2], 0, k[1], k[3], 0, 0, 1}), model, carried.count,
                         numbers(carried.distortion()), numbers({1, 0, 0, 0, 1, 0, 0, 0, 1}),
                         numbers({k[0], 0, k[2], 0, 0, k[1], k[3], 0, 0, 0, 1, 0}))});
    }
    return out;
}

std::string kalibr_text(const std::vector<Carried>& cameras)
{
    std::string text;
    for (std::size_t i = 0; i < cameras.size(); ++i) {
        const RigCamera& camera = cameras[i].camera;
        text += fmt::format("cam{}:\n", i);
        if (i > 0) {
            const Pose step = camera.cam_from_rig * inverse(cameras[i - 1].camera.cam_from_rig);
            text += "  T_cn_cnm1:\n";
            for (int row = 0; row < 3; ++row) {
                text += "  - " + numbers({step.rotation(row, 0), step.rotation(row, 1), step.rotation(row, 2),
                                          kMetresPerMm * step.translation_mm[row]}) + "\n";
            }
            text += "  - [0.0, 0.0, 0.0, 1.0]\n";
        }
        std::string overlaps;
        for (std::size_t j = 0; j < cameras.size(); ++j) {
            overlaps += j == i ? "" : (overlaps.empty() ? "" : ", ") + std::to_string(j);
        }
        const std::vector<double>& k = camera.lens.intrinsics;
        text += fmt::format("  cam_overlaps: [{}]\n  camera_model: pinhole\n  distortion_coeffs: {}\n"
                            "  distortion_model: {}\n  intrinsics: {}\n  resolution: [{}, {}]\n"
                            "  rostopic: {}\n",
                            overlaps, numbers(cameras[i].distortion()),
                            cameras[i].fisheye() ? "equidistant" : "radtan",
                            numbers({k[0], k[1], k[2], k[3]}), camera.width_px, camera.height_px,
                            quoted("/" + camera.name + "/image_raw"));
    }
    return text;
}

std::vector<NamedText> colmap_files(const std::vector<Carried>& cameras)
{
    std::string list = "# Camera list with one line of data per camera:\n"
                       "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n";
    nlohmann::ordered_json rigs = nlohmann::ordered_json::array();  // one a part
    std::size_t first = 0;  // of the part
    for (std::size_t i = 0; i < cameras.size(); ++i) {
        const RigCamera& camera = cameras[i].camera;
        const std::vector<double>& k = camera.lens.intrinsics;
        std::vector<double> parameters{k[0], k[1], k[2] + 0.5, k[3] + 0.5};
        for (const double value : cameras[i].distortion()) {
            parameters.push_back(value);
        }
        const std::string model =
            cameras[i].fisheye() ? "OPENCV_FISHEYE" : cameras[i].count == 4 ? "OPENCV" : "FULL_OPENCV";
        list += fmt::format("{} {} {} {}", i + 1, model, camera.width_px, camera.height_px);
        for (const double value : parameters) {
            list += " " + number(value);
        }
        list += "\n";
        nlohmann::ordered_json entry{{"image_prefix", camera.name + "/"}};
        if (i == 0 || camera.part != cameras[first].camera.part) {
            first = i;
            rigs.push_back({{"cameras", nlohmann::ordered_json::array()}});
            entry["ref_sensor"] = true;
        } else {
            // The reference sensor is the rig frame.
            const Pose pose = camera.cam_from_rig * inverse(cameras[first].camera.cam_from_rig);
            const Eigen::Quaterniond turn = Eigen::Quaterniond(pose.rotation).normalized();
            const Eigen::Vector3d shift = kMetresPerMm * pose.translation_mm;
            entry["cam_from_rig_rotation"] = {turn.w(), turn.x(), turn.y(), turn.z()};
            entry["cam_from_rig_translation"] = {shift.x(), shift.y(), shift.z()};
        }
        entry["camera_model_name"] = model;
        entry["camera_params"] = parameters;
        rigs.back()["cameras"].push_back(entry);
    }
    return {{"cameras.txt", list},
            {"rig_config.json", rigs.dump(2) + "\n"}};
}

std::vector<NamedText> mrcal_files(const std::vector<Carried>& cameras)
{
    std::vector<NamedText> out;
    const bool apart = cameras.front().camera.part != cameras.back().camera.part;
    for (const Carried& carried : cameras) {
        const RigCamera& camera = carried.camera;
        std::vector<double> intrinsics(camera.lens.intrinsics.begin(),
                                       camera.lens.intrinsics.begin() + kPinholeCount);
        for (const double value : carried.distortion()) {
            intrinsics.push_back(value);
        }
        const Eigen::Vector3d turn = rotation_log(camera.cam_from_rig.rotation);
        const Eigen::Vector3d shift = kMetresPerMm * camera.cam_from_rig.translation_mm;
        out.push_back({(apart ? fmt::format("part-{}/", camera.part) : "") + camera.name + ".cameramodel",
                       fmt::format("# Rig frame: that of the first camera{}. Lengths are metres.\n"
                                   "{{\n    'lensmodel':  'LENSMODEL_OPENCV{}',\n"
                                   "    'intrinsics': {},\n    'extrinsics': {},\n"
                                   "    'imagersize': [{}, {}],\n}}\n",
                                   apart ? " of its part" : "", carried.count, numbers(intrinsics),
                                   numbers({turn.x(), turn.y(), turn.z(), shift.x(), shift.y(), shift.z()}),
                                   camera.width_px, camera.height_px)});
    }
    return out;
}

Result<Carried> carry(const RigCamera& camera, const Format& format, bool approximate,
                      std::vector<std::string>* notes)
{
    const bool fisheye = camera.lens.model == CameraModel::kFisheye;
    if (fisheye && !format.fisheye) {
        return Status::failure(format.name + " has no lens model for camera '" + camera.name
                               + "', which is a fisheye");
    }
    const NearestLens nearest = nearest_lens(camera, fisheye ? std::vector<int>{4} : format.counts);
    const std::string off = fmt::format("the nearest that {} has is {:.2g} px off over the image (RMS), "
                                        "{:.2g} px at most", format.name, nearest.rms_px, nearest.most_px);
    if (!nearest.exact && !approximate) {
        return Status::failure(fmt::format("{} cannot carry the lens of camera '{}' ({}): {}; --approximate "
                                           "writes that", format.name, camera.name,
                                           camera_model_name(camera.lens.model), off));
    }
    if (!nearest.exact) {
        notes->push_back("camera '" + camera.name + "': " + off);
    }
    Carried out{camera, static_cast<std::size_t>(nearest.count)};
    // OpenCV takes every parametric lens as it is.
    if (!nearest.exact || format.name != "opencv") {
        out.camera.lens = nearest.lens;
    }
    return out;
}

// "0 (left, right), 1 (top)".
std::string list_parts(const RigFile& rig)
{
    std::string text;
    int last = -1;
    for (const RigCamera& camera : rig.cameras) {
        text += camera.part == last ? ", " + camera.name
                                    : fmt::format("{}{} ({}", last < 0 ? "" : "), ", camera.part, camera.name);
        last = camera.part;
    }
    return text + ")";
}

// The cameras to write, part by part.
Result<std::vector<RigCamera>> choose(const RigFile& rig, const std::string& format, std::optional<int> part)
{
    std::vector<RigCamera> out;
    std::copy_if(rig.cameras.begin(), rig.cameras.end(), std::back_inserter(out),
                 [&](const RigCamera& camera) { return !part || camera.part == *part; });
    std::stable_sort(out.begin(), out.end(),
                     [](const RigCamera& a, const RigCamera& b) { return a.part < b.part; });
    if (out.empty()) {
        return Status::failure(fmt::format("the rig has no part {}; it has {}", *part, list_parts(rig)));
    }
    if (out.front().part != out.back().part && (format == "opencv" || format == "kalibr")) {
        return Status::failure(fmt::format(
            "the rig consists of parts that nothing connects, and a file of {} holds one rig: choose one with "
            "--part, which are {}", format, list_parts(rig)));
    }
    return out;
}

}  // namespace

std::vector<std::string> export_format_names()
{
    std::vector<std::string> out;
    for (const Format& format : formats()) {
        out.push_back(format.name);
    }
    return out;
}

Result<ExportResult> export_rig(const RigFile& rig, const std::string& name, bool approximate,
                                std::optional<int> part)
{
    ExportResult out;
    if (name == "json" && part) {
        return Status::failure("json is the whole rig.json with all its parts: leave --part out");
    }
    if (name == "json") {
        out.files = {{"", rig_text(rig.json)}};
        return out;
    }
    const Result<std::vector<RigCamera>> chosen = choose(rig, name, part);
    if (!chosen.ok()) {
        return chosen.status();
    }
    const Format& format = *std::find_if(formats().begin(), formats().end(),
                                         [&](const Format& each) { return each.name == name; });
    std::vector<Carried> cameras;
    for (const RigCamera& camera : chosen.value()) {
        Result<Carried> carried = carry(camera, format, approximate, &out.notes);
        if (!carried.ok()) {
            return carried.status();
        }
        cameras.push_back(carried.value());
    }
    if (name == "opencv") {
        out.files = {{"", opencv_text(cameras)}};
    } else if (name == "ros") {
        out.files = ros_files(cameras);
        if (cameras.size() > 1) {
            out.notes.push_back("camera_info files carry no poses between cameras");
        }
    } else if (name == "kalibr") {
        out.files = {{"", kalibr_text(cameras)}};
    } else if (name == "colmap") {
        out.files = colmap_files(cameras);
    } else {
        out.files = mrcal_files(cameras);
    }
    return out;
}

}  // namespace rig
