#include "tools/target/target_json.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace target_maker {

namespace {

using Json = nlohmann::ordered_json;

// One row of the grid a line, so that a person can read it.
std::string grid(const std::vector<unsigned>& values, const Wish& wish)
{
    std::string text = "[";
    for (std::size_t row = 0; row < wish.rows; row++) {
        text += row == 0 ? "\n    [" : ",\n    [";
        for (std::size_t col = 0; col < wish.cols; col++) {
            text += fmt::format("{}{}", col == 0 ? "" : ", ", values[row * wish.cols + col]);
        }
        text += "]";
    }
    return text + "\n  ]";
}

}  // namespace

std::string target_json(const Wish& wish, const Choice& choice)
{
    const Json head = {
        {"format", "tessera-target"},
        {"version", 1},
        {"name", wish.name},
        {"rows", wish.rows},
        {"cols", wish.cols},
        {"patch_mm", wish.patch_mm},
        {"levels", wish.levels},
        {"circle_ratio", wish.circle_ratio},
        {"edge_level", wish.edge_level},
        {"gauss_sigma", wish.gauss_sigma},
        {"margin", wish.margin},
    };
    std::string text = "{\n";
    for (const auto& item : head.items()) {
        // Bytes that are not UTF-8 pass through as U+FFFD: the name comes from a command line.
        text += fmt::format("  \"{}\": {},\n", item.key(),
                            item.value().dump(-1, ' ', false, Json::error_handler_t::replace));
    }
    return text + "  \"ids\": " + grid(choice.ids, wish) + ",\n  \"turns\": " +
           grid(choice.turns, wish) + "\n}\n";
}

}  // namespace target_maker
