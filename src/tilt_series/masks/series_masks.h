#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "io/mrc.h"
#include "tilt_series/masks/beads.h"
#include "tilt_series/series_plan.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::tilt_series {

/// Discs of every view that hide beads and fiducials, in its aligned, binned pixels.
struct BeadMasks {
  std::vector<std::vector<MaskDisc>> discs;
  MaskMetrics metrics;  ///< of the beads
};

/// Opens the user's mask (--mask). Throws Error if it is not as large as the stack.
io::MrcReader open_mask(const std::filesystem::path& mask, const io::MrcReader& stack);

/// Marks what is 0 in the mask's section as no measurement.
void apply_mask(const io::MrcReader& mask, std::int64_t section, MaskedImage* image);

/// Beads that the options ask for, and fiducials. `read` gives a view, dense
/// parts high. Throws Error for a diameter that cannot be, or a fiducial file
/// that does not fit the stack.
BeadMasks find_bead_masks(const TiltSeriesOptions& options, const SeriesPlan& plan,
                          const io::MrcReader& stack, const BeadViews& views);

}  // namespace tomofield::tilt_series
