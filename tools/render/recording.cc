/* The files of a recording. */
#include "tools/render/recording.h"

#include <cerrno>
#include <cstdio>
#include <cstring>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace render {

namespace {

void write_file(const std::string& path, const std::string& head, const void* data, std::size_t bytes)
{
    const std::string part = path + ".part";
    std::FILE* file = std::fopen(part.c_str(), "wb");
    bool good = file != nullptr;
    if (file != nullptr) {
        good = std::fwrite(head.data(), 1, head.size(), file) == head.size() &&
               std::fwrite(data, 1, bytes, file) == bytes;
        good = std::fflush(file) == 0 && good;
        const int error = errno;
        good = std::fclose(file) == 0 && good;
        errno = good ? 0 : error;
    }
    if (!good || std::rename(part.c_str(), path.c_str()) != 0) {
        const int error = errno;
        std::remove(part.c_str());
        throw UserError(fmt::format("{}: cannot be written ({}); what was written before stays", path,
                                    std::strerror(error)));
    }
}

nlohmann::ordered_json pose_json(const Pose& pose)
{
    nlohmann::ordered_json out;
    for (int row = 0; row < 3; row++) {
        for (int col = 0; col < 3; col++) {
            out["rotation"].push_back(pose.rotation(row, col));
        }
    }
    out["translation_mm"] = {pose.translation_mm.x(), pose.translation_mm.y(),
                             pose.translation_mm.z()};
    return out;
}

} // namespace

std::string frame_name(int frame, bool as_float)
{
    return fmt::format("frame_{:05}.{}", frame, as_float ? "pfm" : "pgm");
}

void write_pgm(const std::string& path, const Camera& camera, const std::vector<std::uint16_t>& digits)
{
    std::vector<unsigned char> bytes;
    bytes.reserve(digits.size() * 2);
    for (const std::uint16_t digit : digits) {
        if (camera.bits > 8) {
            bytes.push_back(static_cast<unsigned char>(digit >> 8));
        }
        bytes.push_back(static_cast<unsigned char>(digit & 0xff));
    }
    const std::string head = fmt::format("P5\n{} {}\n{}\n", camera.lens.width_px,
                                         camera.lens.height_px, (1 << camera.bits) - 1);
    write_file(path, head, bytes.data(), bytes.size());
}

void write_pfm(const std::string& path, const Camera& camera, const std::vector<double>& grey)
{
    // PFM keeps its rows from the bottom up; a negative scale says little-endian.
    const auto width = static_cast<std::size_t>(camera.lens.width_px);
    std::vector<unsigned char> bytes;
    bytes.reserve(grey.size() * 4);
    for (std::size_t row = grey.size() / width; row-- > 0;) {
        for (std::size_t x = 0; x < width; x++) {
            const auto value = static_cast<float>(grey[row * width + x]);
            std::uint32_t word = 0;
            std::memcpy(&word, &value, sizeof word);
            for (unsigned shift = 0; shift < 32; shift += 8) {
                bytes.push_back(static_cast<unsigned char>((word >> shift) & 0xff));
            }
        }
    }
    const std::string head =
        fmt::format("Pf\n{} {}\n-1.0\n", camera.lens.width_px, camera.lens.height_px);
    write_file(path, head, bytes.data(), bytes.size());
}

void write_text(const std::string& path, const std::string& text)
{
    write_file(path, text, nullptr, 0);
}

std::string truth_header()
{
    return "file,frame,patch,feature,x,y,major,minor,angle,polarity,circle_x,circle_y,visible\n";
}

std::string truth_lines(const std::string& file, int frame, const std::vector<RimTruth>& rims)
{
    std::string out;
    for (const RimTruth& rim : rims) {
        out += fmt::format("{},{},{},{},{:.7f},{:.7f},{:.7f},{:.7f},{:.5f},{},{:.7f},{:.7f},{}\n", file,
                           frame, rim.patch, rim.feature, rim.centre.x(), rim.centre.y(), rim.major_px,
                           rim.minor_px, rim.angle_deg, rim.white ? 1 : 0, rim.circle_centre.x(),
                           rim.circle_centre.y(), rim.visible ? 1 : 0);
    }
    return out;
}

std::string truth_json(const Scene& scene, int first, int end)
{
    nlohmann::ordered_json out;
    out["format"] = "tessera-truth";
    out["version"] = 1;
    for (const Camera& camera : scene.cameras) {
        const Lens& lens = camera.lens;
        nlohmann::ordered_json item;
        item["name"] = camera.name;
        item["width"] = lens.width_px;
        item["height"] = lens.height_px;
        item["model"] = lens.model;
        item["fx"] = lens.fx;
        item["fy"] = lens.fy;
        item["cx"] = lens.cx;
        item["cy"] = lens.cy;
        const std::ptrdiff_t count = lens.model == "brown" ? 5 : 8;
        item["distortion"] = std::vector<double>(lens.distortion.begin(),
                                                 lens.distortion.begin() + count);
        item["cam_from_rig"] = pose_json(camera.cam_from_rig);
        item["exposure_us"] = camera.exposure_us;
        item["row_time_us"] = camera.row_time_us;
        item["psf_sigma_px"] = camera.psf_sigma_px;
        item["noise"] = camera.noise;
        out["cameras"].push_back(item);
    }
    out["boards"] = {{{"name", scene.board}, {"target", "target.json"}}};
    for (int frame = first; frame < end; frame++) {
        const Instant& instant = scene.instants[static_cast<std::size_t>(frame)];
        nlohmann::ordered_json item;
        item["frame"] = frame;
        item["board"] = scene.board;
        item["t_ns"] = instant.t_ns;
        item["rig_from_board"] = pose_json(instant.pose(0));
        out["frames"].push_back(item);
    }
    return out.dump(1) + "\n";
}

} // namespace render
