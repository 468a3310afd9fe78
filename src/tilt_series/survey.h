#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "distributed/communicator.h"
#include "tilt_series/decode_view.h"
#include "tilt_series/half_stacks.h"
#include "tilt_series/image.h"
#include "tilt_series/intensity.h"
#include "tilt_series/masks/series_masks.h"
#include "tilt_series/planned_series.h"
#include "tilt_series/view_store.h"

namespace tomofield::microscope {
struct ViewTransfer;
}

namespace tomofield::tilt_series {

/// What one look at every view of a series has found, and a decoder that uses it.
struct Survey {
  explicit Survey(const PlannedSeries& series);

  /// Returns views for a search for beads.
  BeadViews bead_views(const distributed::Communicator& processes,
                       std::function<MaskedImage(std::size_t)> read) const;
  /// Decodes a view in the frame that the options ask for, as stored intensities.
  MaskedImage decode(std::size_t view) const;
  /// Does the same with one half of the frames.
  MaskedImage decode(Half half, std::size_t view) const;
  /// Returns stored intensities as line integrals, without what masked beads and fiducials hide
  /// and, if the transfer of the view is given, without their fringes.
  MaskedImage line_integrals(MaskedImage image, std::size_t view,
                             const microscope::ViewTransfer* transfer) const;

  PlannedSeries series;
  ViewDecoder decoder;
  IntensityScale intensity;
  double background = 0.0;           ///< of a bright series, in line integrals
  std::vector<double> noise_sigma;   ///< [view]
  BeadMasks beads;                   ///< in the frame that the options ask for
  std::optional<HalfStacks> halves;  ///< matched to all frames
};

/// A survey and the decoded views of this process, as stored intensities without discs of beads.
struct SurveyedViews {
  Survey survey;
  std::unique_ptr<ViewStore> views;
};

/// Says what the plan has noticed, decodes every view, checks and measures it. Each view is decoded
/// once, or twice if a fixed pattern is found: what needs more than one look goes through a store.
/// Of a job of several processes each decodes and stores the views that it owns (own_views.h).
/// Throws Error that names the file and the section; warnings go to base/log.h.
SurveyedViews survey_views(const PlannedSeries& series, const distributed::Communicator& processes);

}  // namespace tomofield::tilt_series
