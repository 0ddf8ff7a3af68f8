// tessera-rig compare: whether two calibrations of a rig are the same.
#include <cstdio>
#include <memory>

#include "host/report/compare.h"
#include "host/rig/commands.h"

namespace rig {
namespace {

struct CompareArguments {
    bool check = false;
    CompareOptions options;
};

Status compare(const CompareArguments& arguments)
{
    const CompareOptions& options = arguments.options;
    const Result<RigFile> a = read_rig_file(options.name_a);
    if (!a.ok()) {
        return a.status();
    }
    const Result<RigFile> b = read_rig_file(options.name_b);
    if (!b.ok()) {
        return b.status();
    }
    if (arguments.check && !(a.value().covariance && b.value().covariance)) {
        return Status::failure((a.value().covariance ? options.name_b : options.name_a)
                               + " holds no 'covariance', which --check needs; solve again with this version");
    }
    const Result<Comparison> comparison = compare_rigs(a.value(), b.value(), options);
    if (!comparison.ok()) {
        return comparison.status();
    }
    if (std::fputs(comparison_text(comparison.value(), options).c_str(), stdout) < 0
        || std::fflush(stdout) != 0) {
        return Status::failure("cannot write to standard output");
    }
    if (arguments.check && comparison.value().differs) {
        return Status::failure(options.name_a + " and " + options.name_b
                               + " differ by more than their uncertainty allows");
    }
    return Status();
}

}  // namespace

void add_compare(CLI::App& app)
{
    auto arguments = std::make_shared<CompareArguments>();
    CLI::App* command = app.add_subcommand(
        "compare", "How far two calibrations of a rig differ, and whether their uncertainty allows it. "
                   "Exit status 0 whatever the verdict; with --check 1 when they differ");
    command->add_option("A", arguments->options.name_a, "rig.json")->required();
    command->add_option("B", arguments->options.name_b, "rig.json of the same cameras")->required();
    command->add_option("--distances", arguments->options.distances_mm,
                        "Distances from the cameras, mm, with commas between; where not given those that A "
                        "was calibrated at")
        ->delimiter(',')
        ->check(CLI::PositiveNumber);
    command->add_flag("--check", arguments->check,
                      "Exit with 1 when they differ by more than their uncertainty allows, or a camera is "
                      "missing in one");
    command->callback([arguments] { finish(compare(*arguments)); });
}

}  // namespace rig
