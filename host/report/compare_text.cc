// The comparison in words.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <iterator>

#include "host/report/compare.h"

namespace rig {
namespace {

std::string verdict_of(const CameraComparison& camera)
{
    const std::string& name = camera.name;
    if (camera.lens.differs && camera.rig.differs) {
        return fmt::format("- '{}': its lens differs, {:.4f} px where {:.4f} px are allowed; as a part of the "
                           "rig it differs by {:.4f} px\n",
                           name, camera.lens.rms_px, camera.lens.allowed_px, camera.rig.rms_px);
    }
    if (camera.lens.differs) {
        return fmt::format("- '{}': its lens differs, {:.4f} px where {:.4f} px are allowed\n", name,
                           camera.lens.rms_px, camera.lens.allowed_px);
    }
    if (camera.rig.differs) {
        return fmt::format("- '{}' has moved by {:.3f} mm and {:.4f} degrees ({:.4f} px where {:.4f} px are "
                           "allowed); its lens is the same\n",
                           name, camera.shift_mm, camera.turn_deg, camera.rig.rms_px, camera.rig.allowed_px);
    }
    return "";
}

std::string verdict_of(const PartComparison& part)
{
    std::string text;
    std::size_t moved = 0;
    for (const CameraComparison& camera : part.cameras) {
        moved += camera.rig.differs && !camera.lens.differs ? 1 : 0;
        text += verdict_of(camera);
    }
    if (moved == part.cameras.size() && moved == 2) {
        text += "  With two cameras it cannot be told which of them moved.\n";
    }
    return text;
}

// What cannot be compared because no rig frame joins it in both; empty where one does.
std::string apart(const Comparison& comparison)
{
    return comparison.parts.size() < 2
               ? ""
               : "How the parts stand to each other was not compared: nothing connects them in one file or "
                 "in both.\n";
}

std::string verdict(const Comparison& comparison, const CompareOptions& options)
{
    std::string text;
    for (const auto& [names, there, missing] :
         {std::tuple(comparison.only_a, options.name_a, options.name_b),
          std::tuple(comparison.only_b, options.name_b, options.name_a)}) {
        if (!names.empty()) {
            text += fmt::format("- in {} but not in {}: '{}'\n", there, missing, fmt::join(names, "', '"));
        }
    }
    for (const PartComparison& part : comparison.parts) {
        text += verdict_of(part);
    }
    if (!comparison.tested) {
        return text + "Whether this is more than the uncertainty allows cannot be told: a file holds no "
                      "covariance.\n";
    }
    if (comparison.differs) {
        return "The two calibrations differ by more than their uncertainty allows:\n" + text;
    }
    return "The two calibrations are the same: they differ by no more than their uncertainty allows.\n";
}

}  // namespace

std::string comparison_text(const Comparison& comparison, const CompareOptions& options)
{
    std::string text;
    const auto out = std::back_inserter(text);
    fmt::format_to(out,
                   "Differences in px over each image, RMS, after the best motion of the rig frame, and for "
                   "the lens\nafter the best motion of the camera; allowed: RMS that the uncertainties "
                   "predict; chance: that\nso large a difference comes from noise\n\n"
                   "{:<16} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}\n",
                   "camera", "rig", "allowed", "most", "chance", "lens", "allowed", "chance", "moved mm", "deg");
    for (const PartComparison& part : comparison.parts) {
        if (comparison.parts.size() > 1) {
            fmt::format_to(out, "part {} of {}, part {} of {}:\n", part.part_a, options.name_a, part.part_b,
                           options.name_b);
        }
        for (const CameraComparison& camera : part.cameras) {
            fmt::format_to(out, "{:<16} {:>9.4f} {:>9.4f} {:>9.4f} {:>9.2g} {:>9.4f} {:>9.4f} {:>9.2g} "
                                "{:>9.4f} {:>9.5f}\n",
                           camera.name, camera.rig.rms_px, camera.rig.allowed_px, camera.rig.most_px,
                           camera.rig.chance, camera.lens.rms_px, camera.lens.allowed_px,
                           camera.lens.chance, camera.shift_mm, camera.turn_deg);
        }
        if (part.places > 0) {
            fmt::format_to(out, "{}In the volume, over {} places: RMS {:.4f} mm, most {:.4f} mm, allowed "
                                "{:.4f} mm\n", comparison.parts.size() > 1 ? "" : "\n",
                           part.places, part.rms_mm, part.most_mm, part.allowed_mm);
        }
    }
    return text + "\n" + verdict(comparison, options) + apart(comparison);
}

}  // namespace rig
