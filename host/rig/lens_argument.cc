// See lens_argument.h.
#include "host/rig/lens_argument.h"

#include <algorithm>
#include <optional>
#include <sstream>

namespace rig {
namespace {

constexpr const char* kLenses = "auto, brown, rational, thin-prism, fisheye, spline, or a model with +spline "
                                "behind it";

struct Entry {
    std::string camera;  // empty: all that are not named
    std::string lens;
};

// Names of cameras hold no comma, but may hold a sign of equality.
std::vector<Entry> entries_of(const std::string& text)
{
    std::vector<Entry> out;
    std::istringstream list(text);
    for (std::string entry; std::getline(list, entry, ',');) {
        const std::size_t sign = entry.rfind('=');
        out.push_back(sign == std::string::npos ? Entry{"", entry}
                                                : Entry{entry.substr(0, sign), entry.substr(sign + 1)});
    }
    return out;
}

std::optional<LensChoice> lens_named(const std::string& name)
{
    const std::string over = "+spline";
    LensChoice out;
    if (name == "auto") {
        out.richer = true;
        return out;
    }
    out.field = name == "spline"
                || (name.size() > over.size()
                    && name.compare(name.size() - over.size(), over.size(), over) == 0);
    const auto model = camera_model_from_name(
        name == "spline" ? "brown" : out.field ? name.substr(0, name.size() - over.size()) : name);
    if (!model) {
        return std::nullopt;
    }
    out.model = *model;
    return out;
}

}  // namespace

std::string lens_argument_fault(const std::string& text)
{
    const std::vector<Entry> entries = entries_of(text);
    if (entries.empty()) {
        return std::string("needs a lens: ") + kLenses;
    }
    std::vector<std::string> named;
    for (const Entry& entry : entries) {
        if (!lens_named(entry.lens)) {
            return "'" + entry.lens + "' is not one of " + kLenses;
        }
        if (std::count(named.begin(), named.end(), entry.camera) != 0) {
            return entry.camera.empty() ? "two lenses are given for the cameras that are not named"
                                        : "two lenses are given for camera '" + entry.camera + "'";
        }
        named.push_back(entry.camera);
    }
    return "";
}

Result<std::vector<LensChoice>> lens_choices(const std::string& text,
                                             const std::vector<SceneCamera>& cameras)
{
    LensChoice rest;
    rest.richer = true;
    const std::vector<Entry> entries = entries_of(text);
    for (const Entry& entry : entries) {
        rest = entry.camera.empty() ? *lens_named(entry.lens) : rest;
    }
    std::vector<LensChoice> out(cameras.size(), rest);
    for (const Entry& entry : entries) {
        const auto found = std::find_if(cameras.begin(), cameras.end(), [&](const SceneCamera& camera) {
            return camera.name == entry.camera;
        });
        if (found != cameras.end()) {
            out[static_cast<std::size_t>(found - cameras.begin())] = *lens_named(entry.lens);
        } else if (!entry.camera.empty()) {
            std::string known;
            for (const SceneCamera& camera : cameras) {
                known += (known.empty() ? "'" : ", '") + camera.name + "'";
            }
            return Status::failure("--model names a camera '" + entry.camera + "' that was not recorded; there "
                                   + (cameras.size() == 1 ? "is " : "are ") + known);
        }
    }
    return out;
}

}  // namespace rig
