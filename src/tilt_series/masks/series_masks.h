#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "io/images/image_stack.h"
#include "io/images/mrc.h"
#include "tilt_series/masks/beads.h"
#include "tilt_series/masks/mask_metrics.h"
#include "tilt_series/series_plan.h"

namespace tomofield::tilt_series {

/// Discs of beads and fiducials, in the aligned, binned pixels of each view.
struct BeadMasks {
  std::vector<std::vector<MaskDisc>> discs;      ///< hide what is masked
  std::vector<std::vector<MaskDisc>> undecided;  ///< of beads that may be masked later
  MaskMetrics metrics;                           ///< of the beads
};

/// Opens the user's mask (--mask). Throws Error if it is not as large as the stack.
io::MrcReader open_mask(const std::filesystem::path& mask, const io::ImageStack& stack);

/// Marks the pixels that are 0 in the mask's section as no measurements, and returns their number.
std::int64_t apply_mask(const io::MrcReader& mask, std::int64_t section, MaskedImage* image);

/// Returns the largest diameter of beads that can be found in views with this shorter side.
double largest_bead_px(double shorter_side_px);

/// Returns true if the options ask for a search for beads.
bool searches_beads(const TiltSeriesOptions& options);

/// Looks for the beads that the options ask for in aligned `views`.
/// Throws Error for a diameter that cannot be.
BeadSearch search_beads(const TiltSeriesOptions& options, const SeriesPlan& plan,
                        const BeadViews& views, const distributed::Communicator& processes);

/// Finds the beads that the options ask for in the aligned `views`, and adds the user's fiducials.
/// Beads that a bright series turns out to have, without a diameter from the user, stay undecided:
/// bright particles may be the specimen itself.
/// Throws Error for a diameter that cannot be, or a fiducial file that does not fit the stack.
BeadMasks find_bead_masks(const TiltSeriesOptions& options, const SeriesPlan& plan,
                          const io::ImageStack& stack, const BeadViews& views,
                          const distributed::Communicator& processes);

}  // namespace tomofield::tilt_series
