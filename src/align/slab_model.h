#pragma once

#include <complex>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "align/image_transform.h"

namespace tomofield::align {

/// Holds one column kx of the frequencies that are compared, and its rows ky.
struct FrequencyColumn {
  std::int64_t kx = 0;
  double fx = 0.0;               ///< cycles a pixel
  std::vector<std::int64_t> ky;  ///< index into the transform
  std::vector<int> shell;        ///< of the frequency's length
};

/// Lists the frequencies of half a plane up to `limit` cycles a pixel, whose part across the tilt
/// axis is `least_fx` at least and not 0.
std::vector<FrequencyColumn> frequencies_below(double limit, double least_fx, std::int64_t width,
                                               std::int64_t height);

/// Holds the transforms of stretched views: for each column a matrix [view, ky].
using Spectra = std::vector<Eigen::MatrixXcd>;

/// Tells how alike the views of a slab are. A stretched view's transform at (kx, ky) is that of the
/// specimen at (kx, ky, −kx tan θ). If the specimen is uncorrelated from place to place and fills a
/// slab, its transform at two heights kz is correlated by the transform of the slab's profile at
/// their difference (here that of a Gaussian with the standard deviation of the slab's thickness).
class SlabModel {
 public:
  SlabModel(const std::vector<FrequencyColumn>& columns, std::span<const double> tilt_deg,
            double thickness_px);

  /// Returns whether the stretched view has a signal at a column: stretching leaves none beyond
  /// half a cycle per pixel of the image.
  bool has_signal(std::size_t view, double fx) const;

  /// Returns the correlation of the views' signals at frequency fx, [view, view].
  Eigen::MatrixXd correlation(double fx) const;

  const std::vector<FrequencyColumn>& columns() const { return columns_; }
  std::size_t num_views() const { return slope_.size(); }

 private:
  std::vector<FrequencyColumn> columns_;
  std::vector<double> slope_, reach_;  // tan θ; the highest frequency in X
  double sigma_px_;
};

}  // namespace tomofield::align
