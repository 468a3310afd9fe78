#pragma once

#include <optional>
#include <span>

namespace tomofield::alignment {

/// An angle that is added to all tilt angles, so that a layer lies level with them, and its
/// standard error.
struct FoundPitch {
  double deg = 0.0, error_deg = 0.0;
};

/// Finds the pitch of a layer of ice by what it lets through. The beam's path through a layer at
/// tilt θ is as long as 1 / cos(θ + pitch), and the part of the electrons that are not lost falls
/// exponentially with it. `intensities` are the means of the views, in any unit that is 0 without a
/// beam. Exposures may drift a little. Returns nothing if the intensities are not those of a layer
/// of ice whose thickness is about `thickness_A`: exposures that follow the tilt, or views that
/// were normalised.
std::optional<FoundPitch> pitch_by_transmission(std::span<const double> tilt_deg,
                                                std::span<const double> intensities,
                                                double thickness_A);

}  // namespace tomofield::alignment
