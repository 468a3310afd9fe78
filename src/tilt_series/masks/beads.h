#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "distributed/communicator.h"
#include "tilt_series/image.h"
#include "tilt_series/masks/mask_metrics.h"

namespace tomofield::tilt_series {

/// A series to be searched: tilts and images of one size, dense parts high.
struct BeadViews {
  std::vector<double> tilt_deg;
  /// Returns the image of a view that this process owns (own_views.h). Thread-safe.
  std::function<MaskedImage(std::size_t view)> read;
  std::optional<double> axis_x_px = {};  ///< x of the tilt axis; none: the middle of the view
  std::size_t at_once = 64;  ///< the largest number of views that may be in memory together
};

struct BeadSearchOptions {
  std::optional<double> diameter_px;  ///< none: estimated, and only clear evidence counts
  double smallest_px = 3.0;           ///< diameters that are tried without one
  double largest_px = 64.0;
};

/// The result of a search; without beads there are no discs.
struct BeadSearch {
  double diameter_px = 0.0;                  ///< given or estimated; 0: none
  std::size_t num_beads = 0;                 ///< with one position in the specimen
  std::vector<std::size_t> num_found;        ///< of each view: beads with a spot of their own
  std::vector<std::vector<MaskDisc>> discs;  ///< of each view: every bead that reaches into it
  std::vector<std::vector<BeadSpot>> spots;  ///< of each bead: where views have a spot of its own
};

/// Looks for fiducial beads: strong round spots (spots.h) that keep one place
/// in the specimen (bead_tracks.h). Every bead gets a disc in every view, where
/// its spot is or, where that is too weak to be seen, where its track passes;
/// spots as strong as those of beads get one as well although no track has
/// them (beads that few views see).
///
/// Without a diameter it is estimated from the views of lowest tilt and some of the others, and
/// beads are believed in only if the evidence is clear. Either at least three have a spot in most
/// views; or at least three have a spot far beyond noise and specimen in four or more of the views
/// that see them, and in most of these, and all together have as many such spots as half of the
/// views.
///
/// Each process looks for spots in the views that it owns; all get the same result.
BeadSearch find_beads(
    const BeadViews& views, const BeadSearchOptions& options,
    const distributed::Communicator& processes = distributed::Communicator::alone());

/// The disc that hides a bead and the fringe around it.
double mask_radius_px(double diameter_px);

/// Marks the pixels whose centres lie in a disc as no measurements.
void mask_discs(const std::vector<MaskDisc>& discs, MaskedImage* image);

/// Marks the measurements whose centres lie in a disc as those of undecided beads.
void mark_undecided(const std::vector<MaskDisc>& discs, MaskedImage* image);

}  // namespace tomofield::tilt_series
