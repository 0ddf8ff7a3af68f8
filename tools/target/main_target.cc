// tessera-target: makes a target file, and draws one as PDF, SVG and PNG.
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "common/targetfile/targetfile.h"
#include "common/version.h"
#include "tools/target/target_choice.h"
#include "tools/target/target_json.h"
#include "tools/target/target_save.h"
#include "tools/target/target_sheets.h"

namespace target_maker {

namespace {

constexpr int kWrongUse = 2;
constexpr int kFailure = 1;
const char* const kMaking = "Making a target";

struct Options {
    Wish wish;
    std::uint64_t seed = 1;
    std::vector<std::string> exclude;
    std::string draw;
    std::string out;
    std::string pdf;
    std::string svg;
    std::string png;
    double dpi = 300;
};

int stop(int exit_code, const std::string& sentence)
{
    fmt::print(stderr, "tessera-target: {}\n", sentence);
    return exit_code;
}

const char* const kFooter =
    "Examples:\n"
    "  tessera-target --rows 7 --cols 12 --patch-mm 100 --out target.json --pdf target.pdf\n"
    "  tessera-target --draw target.json --png target.png --dpi 150\n\n"
    "Without --out the target file goes to standard output. Two targets that are seen together\n"
    "may share no id: make the second with --exclude FIRST.json. Ids and turns depend on size,\n"
    "seed and excluded ids alone (std::mt19937_64), never on the machine.\n"
    "Drawings have true size: print at 100 %, measure the ruler in the caption, and write what\n"
    "you find into the target file as \"measured_scale\": [x, y]. Grey values are the target's\n"
    "reflectances, uncorrected for any printer.";

void add_options(CLI::App& app, Options& options)
{
    Wish& wish = options.wish;
    app.set_version_flag("--version", "tessera-target " TESSERA_VERSION);
    app.footer(kFooter);
    const std::vector<CLI::Option*> making = {
        app.add_option("--rows", wish.rows, "rows of patches"),
        app.add_option("--cols", wish.cols, "columns of patches; rows x cols at most 4096"),
        app.add_option("--patch-mm", wish.patch_mm, "side of a patch, 0.01 to 100000 mm"),
        app.add_option("--seed", options.seed, "seed of ids and turns (1)"),
        app.add_option("--name", wish.name, "name, at most 63 bytes (tessera-ROWSxCOLS-SEED)"),
        app.add_option("--levels", wish.levels, "2: 13 circles a patch; 3: 85 (2)"),
        app.add_option("--circle-ratio", wish.circle_ratio,
                       "circle's radius over its triangle's inradius, 0.05 to 1 (0.5)"),
        app.add_option("--edge-level", wish.edge_level,
                       "grey of a white circle beside its peak, 0.05 to 1 (0.8)"),
        app.add_option("--gauss-sigma", wish.gauss_sigma,
                       "sigma of the peak in circle radii, 0.01 to 100 (0.4)"),
        app.add_option("--margin", wish.margin, "white margin in patch sides, 0 to 10 (0.5)"),
        app.add_option("--exclude", options.exclude,
                       "target file whose ids are not to be used; may be given again")
            ->allow_extra_args(false)
            ->type_name("FILE"),
        app.add_option("-o,--out", options.out, "target file to write")->type_name("FILE"),
    };
    for (CLI::Option* option : making) {
        option->group(kMaking);
    }
    app.add_option("--draw", options.draw, "draw this target file, make none")->type_name("FILE");
    app.add_option("--pdf", options.pdf, "PDF to write: vectors, true size")->type_name("FILE");
    app.add_option("--svg", options.svg, "SVG to write: vectors, true size")->type_name("FILE");
    app.add_option("--png", options.png, "PNG to write: 8-bit grey")->type_name("FILE");
    app.add_option("--dpi", options.dpi, "resolution of the PNG, 1 to 100000 (300)");
    for (const char* drawing : {"--draw", "--pdf", "--svg", "--png", "--dpi"}) {
        app.get_option(drawing)->group("Drawing");
    }
}

// Makes the target that the options ask for: its text in `json`, and read back into `target`, so
// that the reader of target files is the one judge of what is legal. The result is the exit code.
int make_target(const CLI::App& app, const Options& options, std::string& json, targetfile& target)
{
    for (const char* required : {"--rows", "--cols", "--patch-mm"}) {
        if (app.count(required) == 0) {
            return stop(kWrongUse,
                        fmt::format("{} is missing; give --rows, --cols and --patch-mm, or "
                                    "--draw FILE (see --help)",
                                    required));
        }
    }
    char error[TARGETFILE_ERROR_BYTES];
    std::set<unsigned> taken;
    for (const std::string& path : options.exclude) {
        if (!targetfile_read(path.c_str(), &target, error)) {
            return stop(kFailure, error);
        }
        const unsigned patches = static_cast<unsigned>(target.target.rows) * target.target.cols;
        taken.insert(target.target.ids, target.target.ids + patches);
    }
    Wish wish = options.wish;
    if (app.count("--name") == 0) {
        wish.name = fmt::format("tessera-{}x{}-{}", wish.rows, wish.cols, options.seed);
    }
    const std::size_t patches = static_cast<std::size_t>(wish.rows) * wish.cols;
    const rig::Result<Choice> choice = choose_patches(patches, options.seed, taken);
    if (!choice.ok()) {
        return stop(kWrongUse, choice.sentence());
    }
    json = target_json(wish, choice.value());
    if (!targetfile_parse(json.data(), json.size(), "these options make no target", &target,
                          error)) {
        return stop(kWrongUse, error);
    }
    return 0;
}

// Draws everything before anything is written: a drawing that cannot be made leaves no files.
int write_results(const Options& options, const std::string& json, const targetfile& target)
{
    std::vector<std::pair<std::string, std::string>> files;
    if (!options.out.empty()) {
        files.emplace_back(options.out, json);
    }
    const auto add = [&files](const std::string& path, const rig::Result<std::string>& drawing) {
        if (drawing.ok()) {
            files.emplace_back(path, drawing.value());
        }
        return drawing.ok() ? 0 : stop(kFailure, path + ": " + drawing.sentence());
    };
    int exit_code = 0;
    if (!options.pdf.empty() && exit_code == 0) {
        exit_code = add(options.pdf, pdf_of(target));
    }
    if (!options.svg.empty() && exit_code == 0) {
        exit_code = add(options.svg, svg_of(target));
    }
    if (!options.png.empty() && exit_code == 0) {
        exit_code = add(options.png, png_of(target, options.dpi));
    }
    for (const auto& [path, bytes] : files) {
        const rig::Status saved = exit_code == 0 ? save_file(path, bytes) : rig::Status();
        if (!saved.ok()) {
            return stop(kFailure, saved.sentence());
        }
    }
    if (exit_code == 0 && !json.empty() && options.out.empty()) {
        const bool written = std::fwrite(json.data(), 1, json.size(), stdout) == json.size();
        if (std::fflush(stdout) != 0 || !written) {
            return stop(kFailure, "standard output takes no more; is the disk full?");
        }
    }
    return exit_code;
}

int run(const CLI::App& app, const Options& options)
{
    const auto target = std::make_unique<targetfile>();
    std::string json;
    if (app.count("--dpi") != 0 && !(options.dpi >= 1 && options.dpi <= 100000)) {
        return stop(kWrongUse, "--dpi must be a number from 1 to 100000 (see --help)");
    }
    if (app.count("--draw") == 0) {
        const int exit_code = make_target(app, options, json, *target);
        return exit_code != 0 ? exit_code : write_results(options, json, *target);
    }
    for (const CLI::Option* option : app.get_options()) {
        if (option->get_group() == kMaking && option->count() != 0) {
            return stop(kWrongUse, fmt::format("{} makes a target, but --draw asks for an existing "
                                               "one; leave one of them out (see --help)",
                                               option->get_name()));
        }
    }
    if (options.pdf.empty() && options.svg.empty() && options.png.empty()) {
        return stop(kWrongUse, "--draw needs one of --pdf, --svg and --png (see --help)");
    }
    char error[TARGETFILE_ERROR_BYTES];
    if (!targetfile_read(options.draw.c_str(), target.get(), error)) {
        return stop(kFailure, error);
    }
    return write_results(options, json, *target);
}

}  // namespace

}  // namespace target_maker

int main(int argc, char** argv)
{
    target_maker::Options options;
    CLI::App app{"Makes a Tessera target: a grid of coded patches, and draws it at true size.",
                 "tessera-target"};
    target_maker::add_options(app, options);
    try {
        app.parse(argc, argv);
        return target_maker::run(app, options);
    } catch (const CLI::ParseError& error) {
        if (error.get_exit_code() == 0) {
            return app.exit(error);
        }
        return target_maker::stop(target_maker::kWrongUse,
                                  std::string(error.what()) + " (see --help)");
    } catch (const std::exception& error) {
        return target_maker::stop(target_maker::kFailure, error.what());
    }
}
