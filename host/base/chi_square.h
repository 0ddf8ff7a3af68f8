// How unlikely a sum of squares is.
#pragma once

namespace rig {

// The unit Gaussian's value that is as unlikely as a chi-square of `degrees` (any above 0) that is `sum`
// or more, by Wilson and Hilferty's cube root: good to 0.05 for 3 degrees and more up to some 6.
double chi_square_normal(double sum, double degrees);

// Chance of a unit Gaussian above `normal`.
double chance_above(double normal);

}  // namespace rig
