// Fields of lenses and surfaces of boards as rig.json writes them; host/README.md explains the keys.
#pragma once

#include <nlohmann/json.hpp>

#include "host/base/status.h"
#include "host/obs/observation.h"
#include "host/solve/field_errors.h"
#include "host/solve/views.h"

namespace rig {

nlohmann::ordered_json field_json(const SplineField& field);

// The map of solve/field_errors.h: {"columns", "rows", "xx", "xy", "yy"}, px^2.
nlohmann::ordered_json field_errors_json(const FieldErrors& errors);

// The same back; no map where `entry` is null. Fails with a sentence that begins with `where`.
Result<FieldErrors> read_field_errors(const nlohmann::ordered_json& entry, const std::string& where);

// Null for a flat board.
nlohmann::ordered_json surface_json(const Surface& surface, const Board& board);

// Fails with a sentence that names `where` and the key at fault.
Result<SplineField> read_field(const nlohmann::ordered_json& entry, const std::string& where);

}  // namespace rig
