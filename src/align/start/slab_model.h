#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

namespace tomofield::alignment {

/// The likeness of the views of a slab. A stretched view's transform at (kx, ky) is that of the
/// specimen at (kx, ky, −kx tan θ). If the specimen is uncorrelated from place to place and fills a
/// slab, its transform at two heights kz is correlated by the transform of the slab's profile at
/// their difference (here that of a Gaussian with the standard deviation of the slab's thickness).
class SlabModel {
 public:
  SlabModel(std::span<const double> tilt_deg, double thickness_px);

  /// Returns the correlation of the views' signals at `fx` cycles a pixel, [view, view]. It is 0
  /// where stretching leaves no signal: beyond half a cycle per pixel of the image.
  Eigen::MatrixXd correlation(double fx) const;

 private:
  std::vector<double> slope_, reach_;  // tan θ; the highest frequency in X
  double sigma_px_;
};

}  // namespace tomofield::alignment
