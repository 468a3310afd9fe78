#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "align/joint_alignment.h"
#include "align/registration.h"
#include "align/start/transmission_pitch.h"

namespace tomofield::alignment {

/// Finds how thick and how level a specimen is that fills a slab.
///
/// Each view is reduced to a few columns: weighted means over x, under a Gaussian. Along y they
/// keep a band of frequencies. Rows of the same y of all views see the same section of the
/// specimen. If the specimen is uncorrelated from place to place within the slab, the values of
/// such a row are a Gaussian process: the covariance of two of them is the integral over the slab
/// of the product of both Gaussians. The pose is that of the largest likelihood. Views must be
/// aligned, because a shift of a view counts for more than the pose.
class SlabPoseSearch {
 public:
  /// `width` is that of the images. `tilt_deg` and the hand (±1) are as in TiltGeometry. A specimen
  /// that is bounded ends where the untilted view does: rays that leave it at its sides do not
  /// count.
  SlabPoseSearch(std::span<const double> tilt_deg, int hand, std::int64_t width, bool is_bounded);

  /// Takes a view. Its prediction replaces pixels that are no measurement. Different views may be
  /// added by several threads.
  void add(std::size_t view, const ImagePair& images);

  /// Returns the most likely pose near `start`: within a factor of two of its thickness and 12° of
  /// its pitch. The x-axis tilt follows from the heights at which the rows of a part of the image
  /// are most likely: they lie on a line. Errors are standard errors, from the differences between
  /// parts of the rows. A pitch that is `known` is kept. Returns nothing if the images are too low,
  /// or if the likelihood has no maximum there.
  std::optional<FoundPose> find(const SlabPose& start,
                                const std::optional<FoundPitch>& known = std::nullopt) const;

 private:
  using Columns = Eigen::MatrixXd;  // [column, row]
  Columns reduce(std::span<const float> image) const;
  bool counts(std::size_t view, double place, double thickness_px) const;
  Eigen::VectorXd log_likelihood(const SlabPose& pose, double thickness_px,
                                 double height_px = 0.0) const;
  void find_x_tilt(double thickness_px, FoundPose& found) const;

  std::vector<double> tilt_deg_;
  int hand_;
  std::int64_t width_;
  bool is_bounded_;
  double sigma_px_;            // of the Gaussians
  std::vector<double> place_;  // of the columns, relative to the centre of the view
  std::vector<Columns> views_;
};

}  // namespace tomofield::alignment
