// tessera-rig project and unproject: points through a calibrated lens, CSV in, CSV out.
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>

#include "host/base/csv.h"
#include "host/report/rig_file.h"
#include "host/rig/commands.h"

namespace rig {
namespace {

struct ProjectArguments {
    std::string rig;
    std::string camera;
};

// As many digits as it takes to read the same number back.
std::string number_text(double value)
{
    return std::isfinite(value) ? fmt::format("{}", value) : "nan";
}

// Reads rows of `columns` from standard input, writes header and the row that `map` makes of each.
template <typename Map>
Status through(const std::vector<std::string>& columns, const char* header, const Map& map)
{
    std::ios::sync_with_stdio(false);
    CsvReader csv(std::cin, "standard input");
    const Status head = csv.header(columns, {});
    if (!head.ok()) {
        return head;
    }
    std::fprintf(stdout, "%s\n", header);
    std::vector<double> row(columns.size());
    while (csv.next()) {
        for (std::size_t i = 0; i < row.size(); ++i) {
            if (!csv.number_or_nan(i, &row[i])) {
                return csv.status();
            }
        }
        std::fprintf(stdout, "%s\n", map(row).c_str());
    }
    if (csv.status().ok() && (std::fflush(stdout) != 0 || std::ferror(stdout) != 0)) {
        return Status::failure("cannot write to standard output");
    }
    return csv.status();
}

Result<Camera> lens_of(const ProjectArguments& arguments)
{
    Result<RigFile> rig = read_rig_file(arguments.rig);
    if (!rig.ok()) {
        return rig.status();
    }
    Result<RigCamera> camera = find_camera(rig.value(), arguments.camera);
    if (!camera.ok()) {
        return camera.status();
    }
    return camera.value().lens;
}

Status project(const ProjectArguments& arguments)
{
    const Result<Camera> lens = lens_of(arguments);
    if (!lens.ok()) {
        return lens.status();
    }
    const double fold = lens.value().fold_radius();
    return through({"x", "y", "z"}, "x,y", [&](const std::vector<double>& row) {
        const Eigen::Vector2d pixel = lens.value().project({row[0], row[1], row[2]}, fold);
        return number_text(pixel.x()) + "," + number_text(pixel.y());
    });
}

Status unproject(const ProjectArguments& arguments)
{
    const Result<Camera> lens = lens_of(arguments);
    if (!lens.ok()) {
        return lens.status();
    }
    const double fold = lens.value().fold_radius();
    return through({"x", "y"}, "x,y,z", [&](const std::vector<double>& row) {
        const Eigen::Vector3d ray = lens.value().unproject({row[0], row[1]}, fold);
        return number_text(ray.x()) + "," + number_text(ray.y()) + "," + number_text(ray.z());
    });
}

std::shared_ptr<ProjectArguments> add_arguments(CLI::App* command)
{
    auto arguments = std::make_shared<ProjectArguments>();
    command->add_option("RIG", arguments->rig, "rig.json")->required();
    command->add_option("--camera", arguments->camera, "Name of the camera")->required();
    return arguments;
}

}  // namespace

void add_project(CLI::App& app)
{
    CLI::App* command = app.add_subcommand(
        "project", "Points in the camera frame (x,y,z, mm) on stdin to pixels (x,y) on stdout");
    auto arguments = add_arguments(command);
    command->callback([arguments] { finish(project(*arguments)); });
}

void add_unproject(CLI::App& app)
{
    CLI::App* command = app.add_subcommand(
        "unproject", "Pixels (x,y) on stdin to unit rays in the camera frame (x,y,z) on stdout");
    auto arguments = add_arguments(command);
    command->callback([arguments] { finish(unproject(*arguments)); });
}

}  // namespace rig
