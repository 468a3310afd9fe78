#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace tomofield::alignment {

/// Amplifies the part of the values that varies slowly from one view to the next: the first
/// cosines of the discrete cosine transform, up to three times. `values` are in order of tilt.
///
/// A field that was fitted to wrong shifts in x blurs so that it explains those that vary slowly
/// over the tilts. A registration to its projections then shows only a small part of their errors
/// (docs/alignment.md).
void amplify_slow_modes(std::span<double> values);

/// Amplifies the slow modes of the steps of an iteration. Where the field shows the whole error,
/// an amplified step goes too far, and the next one turns back. Then this adds half as much from
/// there on.
class SlowModeAmplifier {
 public:
  void amplify(std::span<double> steps);

 private:
  double part_ = 1.0;               // of what amplify_slow_modes() adds
  std::vector<double> last_added_;  // the whole of it, in the last step
};

}  // namespace tomofield::alignment
