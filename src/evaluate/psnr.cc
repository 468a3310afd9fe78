#include "evaluate/psnr.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "base/check.h"
#include "base/parallel.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

constexpr std::size_t kChunk = std::size_t{1} << 16;

/// Returns N sums of `terms(x, y)` over all voxels. Each fixed chunk has a partial sum; they are
/// added in order.
template <std::size_t N, typename Terms>
std::array<double, N> sum_pairs(std::span<const float> xs, std::span<const float> ys,
                                const Terms& terms) {
  const std::size_t num_chunks = (xs.size() + kChunk - 1) / kChunk;
  std::vector<std::array<double, N>> partial(num_chunks);
  base::parallel_for(static_cast<std::int64_t>(num_chunks), [&](std::int64_t chunk) {
    const std::size_t first = static_cast<std::size_t>(chunk) * kChunk;
    const std::size_t last = std::min(first + kChunk, xs.size());
    std::array<double, N> sum{};
    for (std::size_t i = first; i < last; ++i) {
      const auto values = terms(static_cast<double>(xs[i]), static_cast<double>(ys[i]));
      for (std::size_t n = 0; n < N; ++n) sum[n] += values[n];
    }
    partial[static_cast<std::size_t>(chunk)] = sum;
  });
  std::array<double, N> total{};
  for (const auto& sum : partial)
    for (std::size_t n = 0; n < N; ++n) total[n] += sum[n];
  return total;
}

void require_finite(std::span<const float> values, const char* name) {
  const auto count = std::count_if(values.begin(), values.end(),
                                   [](float value) { return !std::isfinite(value); });
  if (count > 0)
    throw Error(fmt::format("{} of the {}'s {} voxels are NaN or infinite: no score means anything",
                            count, name, values.size()));
}

double peak_of(std::span<const float> truth) {
  const auto [low, high] = std::minmax_element(truth.begin(), truth.end());
  const double peak = static_cast<double>(*high) - std::min(0.0, static_cast<double>(*low));
  if (!(peak > 0.0))
    throw Error(fmt::format(
        "the truth's largest voxel is {}: its range must reach above 0 for a peak to exist",
        *high));
  return peak;
}

}  // namespace

PsnrScore psnr(std::span<const float> reconstruction, std::span<const float> truth) {
  TOMOFIELD_CHECK(reconstruction.size() == truth.size() && !truth.empty(),
                  "both must have the same voxels");
  require_finite(reconstruction, "reconstruction");
  require_finite(truth, "truth");
  PsnrScore score;
  score.peak = peak_of(truth);
  const auto count = static_cast<double>(truth.size());
  const auto to_dB = [&](double squares) {
    return -10.0 * std::log10(squares / count / (score.peak * score.peak));
  };

  const auto first = sum_pairs<3>(reconstruction, truth, [](double x, double y) {
    return std::array{x, y, (x - y) * (x - y)};
  });
  const double mean_x = first[0] / count, mean_y = first[1] / count;
  score.raw_dB = to_dB(first[2]);

  const auto second = sum_pairs<3>(reconstruction, truth, [&](double x, double y) {
    const double dx = x - mean_x, dy = y - mean_y;
    return std::array{dx * dx, dx * dy, dy * dy};
  });
  const auto [xx, xy, yy] = second;
  score.scale = xx > 0.0 ? xy / xx : 0.0;
  score.offset = mean_y - score.scale * mean_x;
  score.correlation = xx > 0.0 && yy > 0.0 ? xy / std::sqrt(xx * yy) : 0.0;

  const auto third = sum_pairs<1>(reconstruction, truth, [&](double x, double y) {
    const double difference = score.scale * x + score.offset - y;
    return std::array{difference * difference};
  });
  score.affine_dB = to_dB(third[0]);
  return score;
}

}  // namespace tomofield::evaluate
