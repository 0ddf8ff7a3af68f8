// See chi_square.h.
#include "host/base/chi_square.h"

#include <cmath>

namespace rig {

double chi_square_normal(double sum, double degrees)
{
    const double ninth = 2.0 / (9.0 * degrees);
    return (std::cbrt(sum / degrees) - (1.0 - ninth)) / std::sqrt(ninth);
}

double chance_above(double normal)
{
    return 0.5 * std::erfc(normal / std::sqrt(2.0));
}

}  // namespace rig
