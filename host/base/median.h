// The middle one of a list.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace rig {

// The value that half of the others do not exceed (the upper of two). Reorders the list, which must
// not be empty.
template <class T>
T median_of(std::vector<T>* values)
{
    const auto middle = values->begin() + static_cast<std::ptrdiff_t>(values->size() / 2);
    std::nth_element(values->begin(), middle, values->end());
    return *middle;
}

}  // namespace rig
