// tessera-bench: the whole detector against one Gaussian blur of the same frame, on one thread.
//
// The machine may be busy with other things, so a time alone says little: each frame is blurred and
// detected in turn, many times, and the median of the pairs' ratios is what is printed.
#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "common/targetfile/targetfile.h"
#include "common/version.h"

extern "C" {
#include "firmware/app/dsp_choice.h"
#include "firmware/app/image_file.h"
#include "firmware/app/pipeline.h"
}

namespace {

// This thread's processor time: what it waits for others does not count.
uint64_t now_ns()
{
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return static_cast<uint64_t>(now.tv_sec) * 1000000000U + static_cast<uint64_t>(now.tv_nsec);
}

double median(std::vector<double> values)
{
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

struct Options {
    std::vector<std::string> frames;
    std::string target;
    std::string dsp = "best";
    int pairs = 11;
    double limit = 0;
};

// The grey levels as float: what the blur is given, made before the clock starts.
cv::Mat float_grey(const frame_view& frame)
{
    cv::Mat grey(frame.height_px, frame.width_px, CV_32F);
    std::vector<uint16_t> row_grey_q4(frame.width_px);
    for (int y = 0; y < grey.rows; y++) {
        luma_span(&frame, static_cast<uint16_t>(y), 0, frame.width_px, row_grey_q4.data());
        for (int x = 0; x < grey.cols; x++) {
            grey.at<float>(y, x) = static_cast<float>(row_grey_q4[static_cast<size_t>(x)]) / 16.0F;
        }
    }
    return grey;
}

struct Outcome {
    double ratio = 0;
    double blur_ms = 0;
    double detect_ms = 0;
    double stage_share[PIPELINE_STAGES] = {};
};

Outcome time_pairs(pipeline& detector, const frame_view& frame, int pairs)
{
    const cv::Mat grey = float_grey(frame);
    cv::Mat blurred;
    std::vector<double> ratios;
    std::vector<double> blur_ms;
    std::vector<double> detect_ms;
    for (int i = 0; i <= pairs; i++) {
        const uint64_t start = now_ns();
        cv::GaussianBlur(grey, blurred, cv::Size(7, 7), 0);
        const uint64_t between = now_ns();
        pipeline_run(&detector, &frame);
        const uint64_t end = now_ns();
        if (i > 0) {  // the first touches fresh memory
            blur_ms.push_back(static_cast<double>(between - start) / 1e6);
            detect_ms.push_back(static_cast<double>(end - between) / 1e6);
            ratios.push_back(detect_ms.back() / blur_ms.back());
        }
    }
    Outcome outcome;
    outcome.ratio = median(ratios);
    outcome.blur_ms = median(blur_ms);
    outcome.detect_ms = median(detect_ms);

    // Shares in runs of their own: reading the clock five times a row costs a few per cent.
    detector.clock = now_ns;
    double spent[PIPELINE_STAGES] = {};
    double total = 0;
    for (int i = 0; i < (pairs + 1) / 2; i++) {
        pipeline_run(&detector, &frame);
        for (unsigned stage = 0; stage < PIPELINE_STAGES; stage++) {
            spent[stage] += static_cast<double>(detector.spent[stage]);
            total += static_cast<double>(detector.spent[stage]);
        }
    }
    detector.clock = nullptr;
    for (unsigned stage = 0; stage < PIPELINE_STAGES; stage++) {
        outcome.stage_share[stage] = spent[stage] / total;
    }
    return outcome;
}

size_t count_features(const pipeline& detector)
{
    size_t count = 0;
    for (uint32_t i = 0; i < detector.patches.count; i++) {
        for (const uint32_t mark : detector.patches.at[i].marks) {
            count += mark != MARKS_NONE ? 1 : 0;
        }
    }
    return count;
}

int run(const Options& options)
{
    cv::setNumThreads(1);
    pipeline_settings settings = pipeline_defaults();
    settings.dsp = dsp_choice_find(options.dsp.c_str());
    if (settings.dsp == nullptr) {
        fmt::print(stderr, "tessera-bench: --dsp {}: not on this machine; give one of {}\n",
                   options.dsp, dsp_choice_names());
        return 2;
    }
    static targetfile target;
    if (!options.target.empty()) {
        char error[TARGETFILE_ERROR_BYTES];
        if (!targetfile_read(options.target.c_str(), &target, error)) {
            fmt::print(stderr, "tessera-bench: {}\n", error);
            return EXIT_FAILURE;
        }
        settings.patches.target = &target.target;
        settings.patches.levels = target.target.levels;
        settings.patches.circle_ratio_q16 = target.target.circle_ratio_q16;
    }
    fmt::print("row kernels: {}; blur: OpenCV {} GaussianBlur 7x7, float32, one thread; "
               "median of {} interleaved pairs\n", settings.dsp->name, CV_VERSION, options.pairs);
    fmt::print("{:>9} {:>8} {:>8} {:>9} {:>6}  ", "frame", "features", "blur ms", "detect ms",
               "ratio");
    for (unsigned stage = 0; stage < PIPELINE_STAGES; stage++) {
        fmt::print("{:>9}", pipeline_stage_name(static_cast<pipeline_stage>(stage)));
    }
    fmt::print("  (share of the time, %)\n");
    double worst = 0;
    for (const std::string& path : options.frames) {
        image_file image;
        char error[IMAGE_FILE_ERROR_BYTES];
        if (!image_file_read(path.c_str(), &image, error)) {
            fmt::print(stderr, "tessera-bench: {}\n", error);
            return EXIT_FAILURE;
        }
        const frame_view& frame = image.frame;
        static pipeline detector;
        const size_t bytes = pipeline_bytes(frame.width_px, frame.height_px);
        const std::unique_ptr<void, decltype(&std::free)> memory(
            std::aligned_alloc(64, (bytes + 63) / 64 * 64), std::free);
        pipeline_init(&detector, memory.get(), bytes, frame.width_px, frame.height_px, &settings);
        const Outcome outcome = time_pairs(detector, frame, options.pairs);
        fmt::print("{:>4}x{:<4} {:>8} {:>8.2f} {:>9.2f} {:>6.2f}  ", frame.width_px, frame.height_px,
                   count_features(detector), outcome.blur_ms, outcome.detect_ms, outcome.ratio);
        for (const double share : outcome.stage_share) {
            fmt::print("{:>9.1f}", 100 * share);
        }
        fmt::print("{}\n", pipeline_truncated(&detector) != 0 ? "  a list was full" : "");
        worst = std::max(worst, outcome.ratio);
        image_file_free(&image);
    }
    fmt::print("worst ratio {:.2f}\n", worst);
    if (options.limit > 0 && worst > options.limit) {
        fmt::print(stderr, "tessera-bench: the worst ratio is {:.2f}, above the limit of {:.2f}\n",
                   worst, options.limit);
        return EXIT_FAILURE;
    }
    return EXIT_SUCCESS;
}

}  // namespace

int main(int argc, char** argv)
{
    Options options;
    CLI::App app{"Times the detector on image files against one Gaussian blur of the same frame."};
    app.set_version_flag("--version", "tessera-bench " TESSERA_VERSION);
    app.add_option("frame", options.frames, "PGM or PNG files")->required();
    app.add_option("--target", options.target, "target file");
    app.add_option("--dsp", options.dsp, std::string("row kernels: best, ") + dsp_choice_names());
    app.add_option("--pairs", options.pairs, "pairs of blur and detection a frame")
        ->check(CLI::Range(1, 1000));
    app.add_option("--limit", options.limit, "fail when a ratio is above this");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        const int code = app.exit(error);
        return code == 0 ? 0 : 2;
    }
    return run(options);
}
