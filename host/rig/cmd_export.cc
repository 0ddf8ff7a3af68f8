// tessera-rig export: the result in the formats of others.
#include <memory>

#include "host/base/whole_file.h"
#include "host/report/export_opencv.h"
#include "host/rig/commands.h"

namespace rig {
namespace {

struct ExportArguments {
    std::string rig;
    std::string format;
    std::string out;
};

Status export_rig(const ExportArguments& arguments)
{
    Result<RigFile> rig = read_rig_file(arguments.rig);
    if (!rig.ok()) {
        return rig.status();
    }
    return write_whole_file(arguments.out, opencv_yaml(rig.value()));
}

}  // namespace

void add_export(CLI::App& app)
{
    auto arguments = std::make_shared<ExportArguments>();
    CLI::App* command = app.add_subcommand("export", "Write a rig.json in another program's format");
    command->add_option("RIG", arguments->rig, "rig.json")->required();
    command->add_option("--format", arguments->format, "opencv: YAML for cv::FileStorage")
        ->required()
        ->check(CLI::IsMember({"opencv"}));
    command->add_option("--out", arguments->out, "File to write")->required();
    command->callback([arguments] { finish(export_rig(*arguments)); });
}

}  // namespace rig
