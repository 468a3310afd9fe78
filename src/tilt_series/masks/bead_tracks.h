#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "tilt_series/masks/spots.h"

namespace tomofield::tilt_series {

/// A bead that keeps its place in the specimen: in a view of tilt θ it is at
/// x = x0 + x cos θ + z sin θ, y, with x0 the middle of the view.
struct BeadTrack {
  double x_px = 0.0, y_px = 0.0, z_px = 0.0;
  std::size_t num_visible = 0;  ///< views in which its place was measured
  std::size_t num_found = 0;    ///< of these, where a spot was found there
  std::size_t num_strong = 0;   ///< of these spots, those as strong as seeds
};

/// The views that tracks are looked for in, in the order of their spots.
struct TrackedViews {
  std::vector<double> tilt_deg;
  double middle_x_px = 0.0;
  /// Returns true if a view has a measurement at this place.
  std::function<bool(std::size_t view, double x_px, double y_px)> is_measured;
};

struct TrackRules {
  double tolerance_px = 2.0;   ///< a spot this near to the track's place belongs to it
  double max_z_px = 0.0;       ///< |z| of a bead
  double seed_strength = 6.0;  ///< of both spots that suggest a track
  double min_part_of_visible =
      0.6;                    ///< at least this part of the views that see its place have a spot
  std::size_t min_views = 4;  ///< and at least this number of views
};

/// Returns the x of a track in a view.
double track_x(const BeadTrack& track, double middle_x_px, double tilt_deg);

/// Returns tracks of beads through spots[view], best first. Two strong spots at the
/// same y in views some 15° apart fix a place; it stands if most views that
/// measure it have a spot there (of any strength). A spot belongs to one track.
/// No sign of the tilt and no position of the axis along z is assumed: both
/// only change z and x.
std::vector<BeadTrack> find_tracks(const std::vector<std::vector<Spot>>& spots,
                                   const TrackedViews& views, const TrackRules& rules);

}  // namespace tomofield::tilt_series
