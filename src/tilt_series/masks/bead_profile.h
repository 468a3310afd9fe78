#pragma once

#include <optional>
#include <vector>

#include "tilt_series/image.h"
#include "tilt_series/masks/spots.h"

namespace tomofield::tilt_series {

/// The mean radial profile of spots, summed over images.
class BeadProfile {
 public:
  /// Begins the profile of spots about this wide; it reaches three diameters far.
  explicit BeadProfile(double about_px);

  /// Adds the measurements around the spots of an image.
  void add(const MaskedImage& image, const std::vector<Spot>& spots);

  /// Returns the height over the surroundings (two to three diameters away) at a distance
  /// in pixels from the centre, relative to the height of the centre.
  double height_at(double radius_px) const;

  /// Returns twice the distance at which the height falls below one half; nothing if there is no
  /// peak.
  std::optional<double> diameter_px() const;

 private:
  double mean(std::size_t ring) const { return count_[ring] > 0 ? sum_[ring] / count_[ring] : 0; }
  double surroundings() const;

  double about_px_;
  double ring_px_;
  std::vector<double> sum_, count_;
};

}  // namespace tomofield::tilt_series
