// tessera-rig export: the result in the formats of others.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>

#include "host/base/whole_file.h"
#include "host/report/export_formats.h"
#include "host/rig/commands.h"

namespace rig {
namespace {

struct ExportArguments {
    std::string rig;
    std::string format;
    std::string out;
    bool approximate = false;
    std::optional<int> part;
};

Status write_all(const std::vector<NamedText>& files, const std::string& out)
{
    for (const NamedText& file : files) {
        std::error_code fault;
        const std::filesystem::path folder(out);
        const std::filesystem::path path = file.name.empty() ? folder : folder / file.name;
        if (!file.name.empty() && !std::filesystem::create_directories(path.parent_path(), fault) && fault) {
            return Status::failure("cannot make folder " + path.parent_path().string() + ": " + fault.message());
        }
        const Status status = write_whole_file(path.string(), file.bytes);
        if (!status.ok()) {
            return status;
        }
    }
    return Status();
}

Status export_one(const ExportArguments& arguments)
{
    Result<RigFile> rig = read_rig_file(arguments.rig);
    if (!rig.ok()) {
        return rig.status();
    }
    const Result<ExportResult> result = export_rig(rig.value(), arguments.format, arguments.approximate,
                                                   arguments.part);
    if (!result.ok()) {
        return result.status();
    }
    const Status status = write_all(result.value().files, arguments.out);
    for (const std::string& note : result.value().notes) {
        if (status.ok()) {
            std::fprintf(stderr, "note: %s\n", note.c_str());
        }
    }
    return status;
}

}  // namespace

void add_export(CLI::App& app)
{
    auto arguments = std::make_shared<ExportArguments>();
    CLI::App* command = app.add_subcommand("export", "Write a rig.json in another program's format");
    command->add_option("RIG", arguments->rig, "rig.json")->required();
    command->add_option("--format", arguments->format,
                        "opencv: YAML for cv::FileStorage; ros: a camera_info YAML a camera; kalibr: camchain "
                        "YAML; colmap: cameras.txt and rig_config.json; mrcal: a .cameramodel a camera; json: "
                        "rig.json")
        ->required()
        ->check(CLI::IsMember(export_format_names()));
    command->add_option("--out", arguments->out,
                        "File to write; for ros, colmap and mrcal the folder to write into")
        ->required();
    command->add_flag("--approximate", arguments->approximate,
                      "Put a lens that the format cannot carry into the nearest that it can, and say how far "
                      "off that is");
    command->add_option("--part", arguments->part,
                        "Only this part of a rig that was solved in parts; opencv and kalibr hold one")
        ->check(CLI::NonNegativeNumber);
    command->callback([arguments] { finish(export_one(*arguments)); });
}

}  // namespace rig
