// The text of a target file; common/target/TARGET.md describes the format.
#ifndef TOOLS_TARGET_TARGET_JSON_H
#define TOOLS_TARGET_TARGET_JSON_H

#include <string>

#include "tools/target/target_choice.h"

namespace target_maker {

// What the user asked for; common/targetfile says which values are legal.
struct Wish {
    std::string name;
    unsigned rows = 0;
    unsigned cols = 0;
    double patch_mm = 0;
    unsigned levels = 2;
    double circle_ratio = 0.5;
    double edge_level = 0.8;
    double gauss_sigma = 0.4;
    double margin = 0.5;
};

std::string target_json(const Wish& wish, const Choice& choice);

}  // namespace target_maker

#endif
