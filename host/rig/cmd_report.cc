// tessera-rig report: the summary of a result, again.
#include <cstdio>
#include <memory>

#include "host/report/rig_file.h"
#include "host/report/summary.h"
#include "host/rig/commands.h"

namespace rig {
namespace {

Status report(const std::string& path)
{
    Result<RigFile> rig = read_rig_file(path);
    if (!rig.ok()) {
        return rig.status();
    }
    Result<std::string> summary = summary_text(rig.value().json, path);
    if (!summary.ok()) {
        return summary.status();
    }
    if (std::fputs(summary.value().c_str(), stdout) < 0 || std::fflush(stdout) != 0) {
        return Status::failure("cannot write to standard output");
    }
    return Status();
}

}  // namespace

void add_report(CLI::App& app)
{
    auto path = std::make_shared<std::string>();
    CLI::App* command = app.add_subcommand("report", "Print the summary of a rig.json");
    command->add_option("RIG", *path, "rig.json")->required();
    command->callback([path] { finish(report(*path)); });
}

}  // namespace rig
