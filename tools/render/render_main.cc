/* tessera-render: frames of a target with their truth, from a scene file. */
#include <algorithm>
#include <atomic>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <sstream>
#include <thread>

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "common/version.h"
#include "tools/render/noise.h"
#include "tools/render/raster.h"
#include "tools/render/recording.h"
#include "tools/render/sensor.h"

namespace render {

namespace {

namespace fs = std::filesystem;

struct Options {
    std::string scene;
    std::string target;
    std::string out;
    std::vector<std::string> only;
    std::string frames;
    std::int64_t seed = -1;
    unsigned jobs = 1;
    int fine = 4;
    bool as_float = false;
    bool truth_only = false;
};

// Frames first..end-1 from "A:B", either end left out at will.
void parse_range(const std::string& text, int count, int& first, int& end)
{
    first = 0;
    end = count;
    if (text.empty()) {
        return;
    }
    const std::size_t colon = text.find(':');
    const auto part = [&](const std::string& digits, int otherwise) {
        if (digits.empty()) {
            return otherwise;
        }
        if (digits.size() > 9 || digits.find_first_not_of("0123456789") != std::string::npos) {
            throw UserError(fmt::format("--frames {}: must be A:B, two frame numbers, B not included", text));
        }
        return std::stoi(digits);
    };
    if (colon == std::string::npos) {
        first = part(text, 0);
        end = first + 1;
    } else {
        first = part(text.substr(0, colon), 0);
        end = part(text.substr(colon + 1), count);
    }
    if (first >= end || end > count) {
        throw UserError(fmt::format("--frames {}: the scene has frames 0:{}", text, count));
    }
}

std::string read_all(const std::string& path)
{
    std::ifstream in(path, std::ios::binary);
    std::ostringstream text;
    text << in.rdbuf();
    return text.str();
}

// A folder for a camera that will hold nothing but this recording's frames.
void prepare_folder(const fs::path& folder, int first, int end, bool as_float)
{
    std::error_code error;
    fs::create_directories(folder, error);
    if (!fs::is_directory(folder)) {
        throw UserError(fmt::format("{}: this folder cannot be made", folder.string()));
    }
    std::set<std::string> ours;
    for (int frame = first; frame < end; frame++) {
        ours.insert(frame_name(frame, as_float));
    }
    for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
        const std::string name = entry.path().filename().string();
        const std::string kind = entry.path().extension().string();
        if (ours.count(name) == 0 && (kind == ".pgm" || kind == ".pfm" || kind == ".png")) {
            throw UserError(fmt::format("{}: belongs to another recording; remove it or name another --out",
                                        entry.path().string()));
        }
    }
}

// One line that is written over on a terminal; else a line at each tenth.
class Progress {
public:
    explicit Progress(int total) : total_(total), terminal_(isatty(STDERR_FILENO) != 0) {}
    void step()
    {
        const std::lock_guard<std::mutex> hold(lock_);
        done_++;
        if (terminal_) {
            std::string bar(static_cast<std::size_t>(30 * done_ / total_), '#');
            bar.resize(30, '.');
            fmt::print(stderr, "\rrendering [{}] {}/{}{}", bar, done_, total_,
                       done_ == total_ ? "\n" : "");
        } else if (10 * done_ / total_ != 10 * (done_ - 1) / total_) {
            fmt::print(stderr, "rendered {} of {} frames\n", done_, total_);
        }
    }

private:
    std::mutex lock_;
    int total_;
    int done_ = 0;
    bool terminal_;
};

// Renders frames first..end-1 of one camera with `jobs` threads; texts are in frame order.
void record_camera(const Scene& scene, std::size_t index, const Mosaic& mosaic, const Options& options,
                   int first, int end, Progress& progress)
{
    const Camera& camera = scene.cameras[index];
    const fs::path folder = fs::path(options.out) / camera.name;
    const int border_px = Stage::border_for(camera);
    const std::uint64_t key = noise_bits(scene.seed, index);
    const Plane backdrop = make_backdrop(camera, border_px, noise_bits(key, 0));
    const Stage stage(camera, mosaic, backdrop, border_px, options.fine);
    std::vector<std::string> lines(static_cast<std::size_t>(end - first));
    std::atomic<int> next{first};
    std::mutex lock;
    std::exception_ptr failure;
    const auto work = [&] {
        for (int frame = next++; frame < end; frame = next++) {
            try {
                const Instant& instant = scene.instants[static_cast<std::size_t>(frame)];
                const std::string name = frame_name(frame, options.as_float);
                lines[static_cast<std::size_t>(frame - first)] =
                    truth_lines(name, frame, find_rims(camera, mosaic, instant));
                if (!options.truth_only) {
                    const std::uint64_t frame_key = noise_bits(key, 1 + static_cast<std::uint64_t>(frame));
                    const std::vector<double> grey = expose(camera, stage.render(instant), frame_key);
                    if (options.as_float) {
                        write_pfm((folder / name).string(), camera, grey);
                    } else {
                        write_pgm((folder / name).string(), camera, digitise(camera, grey));
                    }
                }
                progress.step();
            } catch (...) {
                const std::lock_guard<std::mutex> hold(lock);
                failure = std::current_exception();
                next = end;
            }
        }
    };
    std::vector<std::thread> threads;
    for (unsigned i = 1; i < options.jobs; i++) {
        threads.emplace_back(work);
    }
    work();
    for (std::thread& thread : threads) {
        thread.join();
    }
    if (failure) {
        std::rethrow_exception(failure);
    }
    std::string truth = truth_header();
    std::string times = "file,t_ns\n";
    for (int frame = first; frame < end; frame++) {
        truth += lines[static_cast<std::size_t>(frame - first)];
        times += fmt::format("{},{}\n", frame_name(frame, options.as_float),
                             scene.instants[static_cast<std::size_t>(frame)].t_ns);
    }
    write_text((folder / "truth.csv").string(), truth);
    write_text((folder / "times.csv").string(), times);
}

void record(const Options& options)
{
    Scene scene = read_scene(options.scene, options.target);
    if (options.seed >= 0) {
        scene.seed = static_cast<std::uint64_t>(options.seed);
    }
    int first = 0;
    int end = 0;
    parse_range(options.frames, static_cast<int>(scene.instants.size()), first, end);
    std::vector<std::size_t> chosen;
    for (std::size_t i = 0; i < scene.cameras.size(); i++) {
        const std::string& name = scene.cameras[i].name;
        if (options.only.empty() ||
            std::find(options.only.begin(), options.only.end(), name) != options.only.end()) {
            chosen.push_back(i);
        }
    }
    for (const std::string& name : options.only) {
        if (std::none_of(scene.cameras.begin(), scene.cameras.end(),
                         [&](const Camera& camera) { return camera.name == name; })) {
            throw UserError(fmt::format("--only {}: {} has no camera of this name", name, options.scene));
        }
    }
    for (const std::size_t i : chosen) {
        prepare_folder(fs::path(options.out) / scene.cameras[i].name, first, end, options.as_float);
    }
    const Mosaic mosaic(scene.target);
    write_text((fs::path(options.out) / "target.json").string(), read_all(scene.target_path));
    write_text((fs::path(options.out) / "truth.json").string(), truth_json(scene, first, end));
    Progress progress(static_cast<int>(chosen.size()) * (end - first));
    for (const std::size_t i : chosen) {
        record_camera(scene, i, mosaic, options, first, end, progress);
    }
}

} // namespace

} // namespace render

int main(int argc, char** argv)
{
    render::Options options;
    CLI::App app{"Renders what cameras see of a target on its path, with the truth beside it.\n"
                 "Writes OUT/CAMERA/frame_00000.pgm, times.csv, truth.csv, and OUT/truth.json, target.json.",
                 "tessera-render"};
    app.set_version_flag("--version", "tessera-render " TESSERA_VERSION);
    app.add_option("scene", options.scene, "scene file (tools/render/README.md)")->required();
    app.add_option("--out", options.out, "folder to write to")->required();
    app.add_option("--target", options.target, "target file, instead of the scene's");
    app.add_option("--jobs", options.jobs, "threads")->check(CLI::Range(1, 256));
    app.add_option("--only", options.only, "cameras to render, by name (all)");
    app.add_option("--frames", options.frames, "frames A:B to render, B not included (all)");
    app.add_option("--seed", options.seed, "seed of noise and backdrop, instead of the scene's")
        ->check(CLI::Range(std::int64_t{0}, std::int64_t{1} << 62));
    app.add_option("--fine", options.fine, "sub-cells a pixel along each axis (4)")
        ->check(CLI::Range(1, 16));
    app.add_flag("--float", options.as_float,
                 "write PFM in grey levels of 255, neither rounded nor clipped");
    app.add_flag("--truth-only", options.truth_only, "write the truth, but no frames");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? 0 : 2;
    }
    try {
        render::record(options);
    } catch (const render::UserError& error) {
        fmt::print(stderr, "tessera-render: {}\n", error.what());
        return 1;
    } catch (const std::exception& error) {
        fmt::print(stderr, "tessera-render: {}\n", error.what());
        return 1;
    }
    return 0;
}
