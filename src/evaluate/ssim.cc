#include "evaluate/ssim.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "base/check.h"
#include "base/parallel.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

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
  base::parallel_for(num_bands, [&](std::int64_t band) {
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

}  // namespace tomofield::evaluate
