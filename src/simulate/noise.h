#pragma once

#include <cstdint>
#include <span>

#include "base/random.h"

namespace tomofield::simulate {

/// Returns a Poisson deviate of a mean >= 0. Below a mean of 30 it multiplies uniform deviates,
/// above it uses transformed rejection (PTRS; Hörmann, Insurance Math. Econ. 12, 1993).
std::int64_t poisson(double mean, base::Random& random);

/// Adds independent normal noise to an image [height, width]. Each row has the random stream
/// first_stream + row, so the result does not depend on the number of threads.
void add_gaussian_noise(std::span<float> image, std::int64_t width, double sigma,
                        std::uint64_t seed, std::uint64_t first_stream);

/// Replaces each expected count of an image by a Poisson count, with the same random streams.
void draw_counts(std::span<float> image, std::int64_t width, std::uint64_t seed,
                 std::uint64_t first_stream);

}  // namespace tomofield::simulate
