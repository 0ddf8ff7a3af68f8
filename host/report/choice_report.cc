// See choice_report.h.
#include "host/report/choice_report.h"

#include <fmt/format.h>

#include <iterator>

namespace rig {
namespace {

using nlohmann::ordered_json;

const ordered_json& held_out_of(const ordered_json& rig)
{
    static const ordered_json none;
    const auto found = rig.find("held_out");
    return found != rig.end() ? *found : none;
}

}  // namespace

ordered_json choice_json(const ModelChoice& choice)
{
    if (choice.instants == 0) {
        return nullptr;
    }
    ordered_json out{{"instants", choice.instants}};
    out["rms_sigmas"] = choice.held_out > 0.0 ? ordered_json(choice.held_out) : ordered_json();
    out["allowed_sigmas"] = choice.held_out > 0.0 ? ordered_json(choice.held_out_allowed) : ordered_json();
    out["trials"] = ordered_json::array();
    for (const ModelTrial& trial : choice.trials) {
        out["trials"].push_back({{"model", trial.what},
                                 {"before_sigmas", trial.before},
                                 {"after_sigmas", trial.after},
                                 {"significance", trial.significance},
                                 {"taken", trial.taken}});
    }
    return out;
}

std::string choice_text(const ordered_json& rig)
{
    std::string text;
    const auto out = std::back_inserter(text);
    for (const ordered_json& board : rig.at("boards")) {
        const ordered_json& surface = board.at("surface");
        if (surface.is_object()) {
            fmt::format_to(out, "    board {} is not flat: {:+.0f} to {:+.0f} micrometres, RMS {:.0f}\n",
                           board.at("name").get<std::string>(), surface.at("lowest_um").get<double>(),
                           surface.at("highest_um").get<double>(), surface.at("rms_um").get<double>());
        }
    }
    const ordered_json& held_out = held_out_of(rig);
    if (!held_out.is_object()) {
        return text;
    }
    for (const ordered_json& trial : held_out.at("trials")) {
        fmt::format_to(out, "    {:<22} {:>9.4f} -> {:>7.4f} sigmas held out, {:>5.1f} times significance{}\n",
                       trial.at("model").get<std::string>(), trial.at("before_sigmas").get<double>(),
                       trial.at("after_sigmas").get<double>(), trial.at("significance").get<double>(),
                       trial.at("taken").get<bool>() ? "  taken" : "");
    }
    if (held_out.at("rms_sigmas").is_number()) {
        fmt::format_to(out, "    half the frames predict the other half to {:.3f} sigmas; up to {:.3f} is chance\n",
                       held_out.at("rms_sigmas").get<double>(),
                       held_out.at("allowed_sigmas").get<double>());
    }
    return text;
}

std::string choice_warning(const ordered_json& rig)
{
    const ordered_json& held_out = held_out_of(rig);
    if (!held_out.is_object() || !held_out.at("rms_sigmas").is_number()
        || !(held_out.at("rms_sigmas").get<double>() > held_out.at("allowed_sigmas").get<double>())) {
        return "";
    }
    return fmt::format("half the frames predict the other half to {:.2f} sigmas, where {:.2f} is allowed: the "
                       "standard deviations are too small to be trusted. Try --model auto and no --flat; check "
                       "that no camera moved, that clocks agree and that the board did not change its shape",
                       held_out.at("rms_sigmas").get<double>(), held_out.at("allowed_sigmas").get<double>());
}

}  // namespace rig
