#pragma once

#include <cstdint>
#include <span>

#include "base/random.h"

namespace tomofield::simulate {

/// Poisson deviate of mean `mean` >= 0: products of uniforms below a mean of
/// 30, transformed rejection (PTRS; Hörmann, Insurance Math. Econ. 12, 1993) above.
std::int64_t poisson(double mean, base::Random& random);

/// Adds independent normal noise to an image [height, width], rows in parallel.
/// Each row owns the random stream first_stream + row.
void add_gaussian_noise(std::span<float> image, std::int64_t width, double sigma,
                        std::uint64_t seed, std::uint64_t first_stream);

/// Replaces each expected count by a Poisson count, likewise.
void draw_counts(std::span<float> image, std::int64_t width, std::uint64_t seed,
                 std::uint64_t first_stream);

}  // namespace tomofield::simulate
