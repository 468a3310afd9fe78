#pragma once

#include <cstdint>
#include <vector>

#include "field/field.h"

namespace tomofield::fit {

/// How much the density varies inside each leaf: its standard deviation over
/// stratified random points, one in each of 8 × 8 × 16 equal boxes (x, y, z); 0
/// outside the region of interest. `pass` chooses the points of one update, which
/// depend on nothing else but the seed and the leaf's square.
std::vector<double> leaf_errors(const field::Field& field, std::uint64_t seed, std::uint64_t pass);

}  // namespace tomofield::fit
