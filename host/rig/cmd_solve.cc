// tessera-rig solve: from observations to a calibrated rig.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <memory>
#include <thread>

#include "host/base/whole_file.h"
#include "host/obs/baselines.h"
#include "host/obs/observe.h"
#include "host/obs/repeats.h"
#include "host/obs/scene.h"
#include "host/report/export.h"
#include "host/report/picture.h"
#include "host/report/rig_file.h"
#include "host/report/summary.h"
#include "host/report/surface_picture.h"
#include "host/rig/commands.h"
#include "host/rig/lens_argument.h"
#include "host/solve/prior.h"
#include "host/solve/rig.h"

namespace rig {
namespace {

struct SolveArguments {
    std::vector<std::string> inputs;
    std::vector<std::string> targets;
    std::string out;
    std::string model = "auto";
    double tolerance_us = -1.0;
    bool flat = false;
    bool partial = false;
    std::string prior;
    bool prior_poses = false;
    std::vector<std::string> baselines;
    std::vector<std::string> row_times;  // cameras whose row time is to be found
    int threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
};

void say(const std::string& line)
{
    std::fprintf(stderr, "%s\n", line.c_str());
}

// Options as given, without the output's place.
Origin origin_of(const SolveArguments& arguments, const Scene& scene)
{
    Origin origin{"tessera-rig solve", scene.inputs};
    for (const std::string& input : arguments.inputs) {
        origin.command += " " + input;
    }
    for (const std::string& target : arguments.targets) {
        origin.command += " --target " + target;
    }
    if (arguments.tolerance_us >= 0.0) {
        origin.command += fmt::format(" --sync-tolerance-us {}", arguments.tolerance_us);
    }
    origin.command += " --model " + arguments.model + (arguments.flat ? " --flat" : "")
                      + (arguments.partial ? " --partial" : "");
    if (!arguments.prior.empty()) {
        origin.command += " --prior " + arguments.prior + (arguments.prior_poses ? " --prior-poses" : "");
    }
    for (const std::string& baseline : arguments.baselines) {
        origin.command += " --baseline " + baseline;
    }
    for (const std::string& camera : arguments.row_times) {
        origin.command += " --estimate-row-time " + camera;
    }
    return origin;
}

// Marks the cameras of --estimate-row-time.
Status mark_row_times(const std::vector<std::string>& names, Scene* scene)
{
    for (const std::string& name : names) {
        const auto found = std::find_if(scene->cameras.begin(), scene->cameras.end(),
                                        [&](const SceneCamera& camera) { return camera.name == name; });
        if (found == scene->cameras.end()) {
            return Status::failure("--estimate-row-time: there is no camera '" + name + "'");
        }
        found->row_time_ns = 0.0;
        found->estimate_row_time = true;
    }
    return Status();
}

Result<Scene> read_input(const SolveArguments& arguments)
{
    if (arguments.inputs.size() == 1 && std::filesystem::is_directory(arguments.inputs[0])) {
        if (!arguments.targets.empty()) {
            return Status::failure("an observation folder names its targets itself in scene.json; leave "
                                   "--target out");
        }
        return read_scene(arguments.inputs[0]);
    }
    std::error_code fault;
    if (!std::filesystem::exists(arguments.inputs[0], fault)) {
        return Status::failure("cannot open " + arguments.inputs[0] + ": there is no such file or folder");
    }
    if (arguments.targets.empty()) {
        return Status::failure("journals need the target that the cameras saw: give it with --target");
    }
    ObserveOptions options;
    options.tolerance_ns = arguments.tolerance_us < 0.0
                               ? -1
                               : static_cast<std::int64_t>(1000.0 * arguments.tolerance_us);
    return observe(arguments.inputs, arguments.targets, options);
}

Status read_prior(const SolveArguments& arguments, const Scene& scene, SolveOptions* options, Prior* prior)
{
    Result<RigFile> rig = read_rig_file(arguments.prior);
    if (!rig.ok()) {
        return rig.status();
    }
    if (!rig.value().covariance || in_parts(rig.value())) {
        return Status::failure(arguments.prior + (in_parts(rig.value())
                                                      ? " consists of parts that nothing connects"
                                                      : " holds no 'covariance'")
                               + ": it cannot be a prior; solve it again");
    }
    prior->source = arguments.prior;
    prior->poses = arguments.prior_poses;
    prior->covariance = *rig.value().covariance;
    std::vector<Eigen::Vector2i> sizes_px;
    for (const RigCamera& camera : rig.value().cameras) {
        prior->names.push_back(camera.name);
        prior->lenses.push_back(camera.lens);
        prior->cam_from_rig.push_back(camera.cam_from_rig);
        sizes_px.emplace_back(camera.width_px, camera.height_px);
    }
    return match_prior(scene, sizes_px, &options->lenses, prior);
}

Status write_result(const SolveArguments& arguments, const Scene& scene, const Solution& solution)
{
    const std::filesystem::path folder = arguments.out;
    std::error_code fault;
    std::filesystem::create_directories(folder, fault);
    if (fault) {
        return Status::failure("cannot make folder " + arguments.out + ": " + fault.message());
    }
    const Statistics statistics = make_statistics(scene, solution);
    const nlohmann::ordered_json rig =
        rig_json(scene, solution, statistics, origin_of(arguments, scene));
    Result<std::string> summary = summary_text(rig, "rig.json");
    if (!summary.ok()) {
        return summary.status();
    }
    Status status = write_whole_file((folder / "rig.json").string(), rig_text(rig));
    if (status.ok()) {
        status = write_whole_file((folder / "summary.txt").string(), summary.value());
    }
    for (std::size_t i = 0; i < solution.cameras.size() && status.ok(); ++i) {
        const SceneCamera& camera = scene.cameras[static_cast<std::size_t>(solution.cameras[i])];
        status = write_whole_file((folder / ("residuals-" + camera.name + ".png")).string(),
                                  residual_png(scene, solution, statistics, i));
    }
    for (std::size_t b = 0; b < scene.boards.size() && status.ok(); ++b) {
        const Surface* surface = surface_of(solution.state, static_cast<int>(b));
        if (surface != nullptr) {
            std::string name = scene.boards[b].name;  // may be a path
            std::replace(name.begin(), name.end(), '/', '_');
            status = write_whole_file((folder / ("surface-" + name + ".png")).string(),
                                      surface_png(*surface, scene.boards[b]));
        }
    }
    if (status.ok()) {
        std::fputs(summary.value().c_str(), stdout);
        say(fmt::format("wrote {0}/rig.json, {0}/summary.txt and {0}/residuals-*.png", arguments.out));
    }
    return status;
}

Status solve(const SolveArguments& arguments)
{
    Result<Scene> scene = read_input(arguments);
    if (!scene.ok()) {
        return scene.status();
    }
    for (const std::string& baseline : arguments.baselines) {
        const Status known = add_baseline(baseline, "--baseline", &scene.value());
        if (!known.ok()) {
            return known;
        }
    }
    drop_repeats(&scene.value());
    const Status marked = mark_row_times(arguments.row_times, &scene.value());
    if (!marked.ok()) {
        return marked;
    }
    say(fmt::format("read {} observations of {} cameras", scene.value().observations.size(),
                    scene.value().cameras.size()));
    const Result<std::vector<LensChoice>> lenses = lens_choices(arguments.model, scene.value().cameras);
    if (!lenses.ok()) {
        return lenses.status();
    }
    SolveOptions options;
    options.lenses = lenses.value();
    options.flat = arguments.flat;
    options.partial = arguments.partial;
    options.threads = arguments.threads;
    Prior prior;
    if (!arguments.prior.empty()) {
        const Status status = read_prior(arguments, scene.value(), &options, &prior);
        if (!status.ok()) {
            return status;
        }
        options.prior = &prior;
    }
    const std::clock_t before = std::clock();
    Result<Solution> solution = solve_rig(scene.value(), options, say);
    if (!solution.ok()) {
        return solution.status();
    }
    say(fmt::format("solved in {:.2f} s of the processor",
                    static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC));
    return write_result(arguments, scene.value(), solution.value());
}

}  // namespace

void add_solve(CLI::App& app)
{
    auto arguments = std::make_shared<SolveArguments>();
    CLI::App* command = app.add_subcommand("solve", "Calibrate the rig from journals or observations");
    command->add_option("INPUT", arguments->inputs, "An observation folder, or journals")->required();
    command->add_option("--target", arguments->targets, "Target file of the journals; may be repeated");
    command->add_option("--out", arguments->out, "Folder for rig.json, summary.txt and pictures")
        ->required();
    command->add_option("--model", arguments->model,
                        "Lens of all cameras: auto (brown, and richer where held-out frames gain by it), brown, "
                        "rational, thin-prism, fisheye, spline (a smooth field over brown; rational+spline and "
                        "the like: over others). Or camera by camera: cam0=spline,cam1=brown; an entry without "
                        "a camera is for all others")
        ->check(CLI::Validator(lens_argument_fault, "LENS"))
        ->capture_default_str();
    command->add_option("--sync-tolerance-us", arguments->tolerance_us,
                        "Captures of journals this close make one instant; a tenth of the frame interval "
                        "where not given")
        ->check(CLI::Range(0.0, 1e9));
    command->add_flag("--flat", arguments->flat, "Hold the boards flat");
    command->add_flag("--partial", arguments->partial,
                      "Solve each connected part by itself when not all cameras are connected");
    CLI::Option* prior = command->add_option(
        "--prior", arguments->prior,
        "rig.json of an earlier result: its lenses, with their covariance, are known beforehand");
    command->add_flag("--prior-poses", arguments->prior_poses,
                      "And how its cameras stand to each other")
        ->needs(prior);
    command->add_option("--baseline", arguments->baselines,
                        "CAMERA,CAMERA,MM,SIGMA_MM: a known distance of two cameras' centres, compared with the "
                        "result; may be repeated")
        ->allow_extra_args(false);
    command->add_option("--estimate-row-time", arguments->row_times,
                        "Find the row time of this camera's rolling shutter; may be repeated. One of another "
                        "camera must be known");
    command->add_option("--threads", arguments->threads,
                        "Threads to compute on, all cores where not given; the result is the same")
        ->check(CLI::Range(1, 1024));
    command->callback([arguments] { finish(solve(*arguments)); });
}

}  // namespace rig
