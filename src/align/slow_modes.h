#pragma once

#include <span>

namespace tomofield::align {

/// Amplifies the part of the values that varies slowly from one view to the next: the first
/// cosines of the discrete cosine transform, up to three times. `values` are in order of tilt.
///
/// A field that was fitted to wrong shifts in x blurs so that it explains those that vary slowly
/// over the tilts. A registration to its projections then shows only a small part of their errors
/// (docs/alignment.md).
void amplify_slow_modes(std::span<double> values);

}  // namespace tomofield::align
