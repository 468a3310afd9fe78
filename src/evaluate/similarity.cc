#include "evaluate/similarity.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "base/check.h"
#include "base/threads/parallel.h"
#include "base/utf8.h"
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
  base::parallel_for(
      "sum differences", static_cast<std::int64_t>(num_chunks), [&](std::int64_t chunk) {
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
  if (*low == *high)
    throw Error(
        fmt::format("every voxel of the truth is {}: there is nothing to compare with", *high));
  if (!(peak > 0.0))
    throw Error(fmt::format(
        "the truth's largest voxel is {}: its range must reach above 0 for a peak to exist",
        *high));
  return peak;
}

constexpr std::int64_t kWindow = 7;
constexpr double kWindowVoxels = 343.0;
constexpr std::int64_t kBandRows = 32;  // rows of windows; the sums of a band fit the L2 cache
constexpr std::size_t kNumSums = 5;     // of x, y, x², y², xy

/// Holds five planes [rows, width] of window sums, one after the other.
using Planes = std::vector<double>;

struct Statistics {
  double mean_x, mean_y, variance_x, variance_y, covariance;
};

double similarity(const Statistics& s, double peak) {
  const double c1 = (0.01 * peak) * (0.01 * peak), c2 = (0.03 * peak) * (0.03 * peak);
  return (2.0 * s.mean_x * s.mean_y + c1) * (2.0 * s.covariance + c2) /
         ((s.mean_x * s.mean_x + s.mean_y * s.mean_y + c1) * (s.variance_x + s.variance_y + c2));
}

/// Computes the windows whose first rows are [first_row, first_row + num_rows). It walks along z
/// and keeps the sums of the last seven sections in a ring.
class Band {
 public:
  Band(const base::Volume& x, const base::Volume& y, std::int64_t first_row, std::int64_t num_rows)
      : x_(x),
        y_(y),
        width_(x.shape.nx),
        windows_(x.shape.nx - kWindow + 1),
        first_row_(first_row),
        num_rows_(num_rows),
        column_sums_(kNumSums * static_cast<std::size_t>(width_)),
        totals_(kNumSums * static_cast<std::size_t>(num_rows * windows_)) {
    ring_.fill(Planes(totals_.size()));
  }

  /// Returns the sums of both similarities over all windows of the band.
  SsimScore run(double peak, double scale, double offset) {
    SsimScore sum;
    for (std::int64_t z = 0; z < x_.shape.nz; ++z) {
      sum_section(z, ring_[static_cast<std::size_t>(z % kWindow)]);
      if (z + 1 >= kWindow) add_similarities(peak, scale, offset, sum);
    }
    return sum;
  }

 private:
  /// Sums 7 × 7 squares of one section: down the columns first, then along x.
  void sum_section(std::int64_t z, Planes& planes) {
    for (std::int64_t row = 0; row < num_rows_; ++row) {
      sum_columns(z, first_row_ + row);
      for (std::size_t n = 0; n < kNumSums; ++n) {
        const double* columns = column_sums_.data() + static_cast<std::int64_t>(n) * width_;
        double* out = planes.data() + (static_cast<std::int64_t>(n) * num_rows_ + row) * windows_;
        for (std::int64_t i = 0; i < windows_; ++i) {
          double sum = 0.0;
          for (std::int64_t k = 0; k < kWindow; ++k) sum += columns[i + k];
          out[i] = sum;
        }
      }
    }
  }

  void sum_columns(std::int64_t z, std::int64_t top_row) {
    std::fill(column_sums_.begin(), column_sums_.end(), 0.0);
    double* sums = column_sums_.data();
    for (std::int64_t row = top_row; row < top_row + kWindow; ++row) {
      const float* x = x_.data.data() + x_.index(0, row, z);
      const float* y = y_.data.data() + y_.index(0, row, z);
      for (std::int64_t i = 0; i < width_; ++i) {
        const double a = static_cast<double>(x[i]), b = static_cast<double>(y[i]);
        sums[i] += a;
        sums[width_ + i] += b;
        sums[2 * width_ + i] += a * a;
        sums[3 * width_ + i] += b * b;
        sums[4 * width_ + i] += a * b;
      }
    }
  }

  void add_similarities(double peak, double scale, double offset, SsimScore& sum) {
    const std::size_t count = totals_.size();
    for (std::size_t i = 0; i < count; ++i) {
      double total = 0.0;
      for (const Planes& planes : ring_) total += planes[i];
      totals_[i] = total / kWindowVoxels;
    }
    const std::size_t stride = count / kNumSums;
    const double* mean = totals_.data();
    constexpr double kToSample = kWindowVoxels / (kWindowVoxels - 1.0);
    double raw = 0.0, affine = 0.0;
    for (std::size_t i = 0; i < stride; ++i) {
      const double mx = mean[i], my = mean[stride + i];
      Statistics s{.mean_x = mx,
                   .mean_y = my,
                   .variance_x = kToSample * (mean[2 * stride + i] - mx * mx),
                   .variance_y = kToSample * (mean[3 * stride + i] - my * my),
                   .covariance = kToSample * (mean[4 * stride + i] - mx * my)};
      raw += similarity(s, peak);
      s.mean_x = scale * mx + offset;
      s.variance_x *= scale * scale;
      s.covariance *= scale;
      affine += similarity(s, peak);
    }
    sum.raw += raw;
    sum.affine += affine;
  }

  const base::Volume& x_;
  const base::Volume& y_;
  std::int64_t width_, windows_, first_row_, num_rows_;
  std::vector<double> column_sums_;
  Planes totals_;
  std::array<Planes, kWindow> ring_;
};

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

SsimScore ssim(const base::Volume& reconstruction, const base::Volume& truth, double peak,
               double scale, double offset) {
  const base::Shape3& shape = truth.shape;
  TOMOFIELD_CHECK(reconstruction.shape == shape, "both must have the same shape");
  if (std::min({shape.nx, shape.ny, shape.nz}) < kWindow)
    throw Error(fmt::format("SSIM needs {} voxels along each axis, but there are {} × {} × {}",
                            kWindow, shape.nx, shape.ny, shape.nz));
  const std::int64_t rows = shape.ny - kWindow + 1;
  const std::int64_t num_bands = (rows + kBandRows - 1) / kBandRows;
  std::vector<SsimScore> partial(static_cast<std::size_t>(num_bands));
  base::parallel_for("similarity", num_bands, [&](std::int64_t band) {
    const std::int64_t first = band * kBandRows;
    Band windows(reconstruction, truth, first, std::min(kBandRows, rows - first));
    partial[static_cast<std::size_t>(band)] = windows.run(peak, scale, offset);
  });
  SsimScore mean;
  for (const SsimScore& sum : partial) {
    mean.raw += sum.raw;
    mean.affine += sum.affine;
  }
  const auto count =
      static_cast<double>((shape.nx - kWindow + 1) * rows * (shape.nz - kWindow + 1));
  return {.raw = mean.raw / count, .affine = mean.affine / count};
}

Comparison compare(const VolumePair& pair) {
  Comparison comparison;
  comparison.box = pair.box;
  comparison.psnr = psnr(pair.first.data, pair.second.data);
  comparison.ssim = ssim(pair.first, pair.second, comparison.psnr.peak, comparison.psnr.scale,
                         comparison.psnr.offset);
  return comparison;
}

}  // namespace tomofield::evaluate
