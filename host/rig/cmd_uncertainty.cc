// tessera-rig uncertainty: what a calibration's covariance means in pixels and millimetres.
#include <cstdio>
#include <filesystem>
#include <memory>

#include "host/base/whole_file.h"
#include "host/report/uncertainty_report.h"
#include "host/rig/commands.h"

namespace rig {
namespace {

struct UncertaintyArguments {
    std::string rig;
    std::string out;
    UncertaintyOptions options;
};

Status uncertainty(const UncertaintyArguments& arguments)
{
    Result<RigFile> rig = read_rig_file(arguments.rig);
    if (!rig.ok()) {
        return rig.status();
    }
    const Result<UncertaintyReport> report =
        uncertainty_report(rig.value(), arguments.options, arguments.rig);
    if (!report.ok()) {
        return report.status();
    }
    if (!arguments.out.empty()) {
        std::error_code fault;
        std::filesystem::create_directories(arguments.out, fault);
        if (fault) {
            return Status::failure("cannot make folder " + arguments.out + ": " + fault.message());
        }
        for (const NamedText& file : report.value().files) {
            const Status status = write_whole_file(
                (std::filesystem::path(arguments.out) / file.name).string(), file.bytes);
            if (!status.ok()) {
                return status;
            }
        }
    }
    if (std::fputs(report.value().table.c_str(), stdout) < 0 || std::fflush(stdout) != 0) {
        return Status::failure("cannot write to standard output");
    }
    return Status();
}

}  // namespace

void add_uncertainty(CLI::App& app)
{
    auto arguments = std::make_shared<UncertaintyArguments>();
    CLI::App* command = app.add_subcommand(
        "uncertainty", "Error bars of a rig.json in pixels over the images and in mm in the volume");
    command->add_option("RIG", arguments->rig, "rig.json")->required();
    command->add_option("--distances", arguments->options.distances_mm,
                        "Distances from the cameras, mm, with commas between; where not given the least, "
                        "median and most of the calibration")
        ->delimiter(',')
        ->check(CLI::PositiveNumber);
    command->add_option("--noise-px", arguments->options.noise_px,
                        "Noise of later observations, px per axis, that triangulation adds")
        ->check(CLI::NonNegativeNumber);
    command->add_option("--out", arguments->out,
                        "Folder for projection.csv, poses.csv, triangulation.csv and "
                        "uncertainty-CAMERA.png");
    command->callback([arguments] { finish(uncertainty(*arguments)); });
}

}  // namespace rig
