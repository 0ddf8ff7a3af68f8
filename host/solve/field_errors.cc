// See field_errors.h.
#include "host/solve/field_errors.h"

#include <algorithm>
#include <cmath>

namespace rig {

Eigen::Matrix2d FieldErrors::at(const Eigen::Vector2d& pixel, int width_px, int height_px) const
{
    if (empty()) {
        return Eigen::Matrix2d::Zero();
    }
    const double x = std::clamp(pixel.x() / (width_px - 1.0), 0.0, 1.0) * (columns - 1);
    const double y = std::clamp(pixel.y() / (height_px - 1.0), 0.0, 1.0) * (rows - 1);
    const int left = std::min(static_cast<int>(x), columns - 2);
    const int top = std::min(static_cast<int>(y), rows - 2);
    const double u = x - left;
    const double v = y - top;
    const auto place = [&](int dx, int dy) -> const Eigen::Matrix2d& {
        return px2[static_cast<std::size_t>((top + dy) * columns + left + dx)];
    };
    return (1.0 - v) * ((1.0 - u) * place(0, 0) + u * place(1, 0))
           + v * ((1.0 - u) * place(0, 1) + u * place(1, 1));
}

}  // namespace rig
