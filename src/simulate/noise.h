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

/// Adds normal noise of the deviation `sigma` that is white noise blurred by a Gaussian whose
/// standard deviation is `blur_px` > 0: its power falls as exp(−(2π blur f)²) with the frequency f
/// in cycles a pixel. It continues from each edge to the opposite one. The random streams are as
/// above.
void add_blurred_noise(std::span<float> image, std::int64_t width, double sigma, double blur_px,
                       std::uint64_t seed, std::uint64_t first_stream);

/// Replaces each expected count of an image by a Poisson count, with the same random streams.
void draw_counts(std::span<float> image, std::int64_t width, std::uint64_t seed,
                 std::uint64_t first_stream);

}  // namespace tomofield::simulate
