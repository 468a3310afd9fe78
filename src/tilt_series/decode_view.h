#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "io/images/mrc.h"
#include "tilt_series/fixed_pattern/fixed_pattern.h"
#include "tilt_series/fixed_pattern/pattern_search.h"
#include "tilt_series/half_stacks.h"
#include "tilt_series/image.h"
#include "tilt_series/planned_series.h"

namespace tomofield::tilt_series {

/// Values of pixels that are larger are no measurements: squares and sums of those up to it are
/// finite floats. A view whose pixels differ by no more than the smallest difference is constant.
inline constexpr float kLargestPixelValue = 1e15f;
inline constexpr float kSmallestDifference = 1e-18f;

/// Counts of the raw pixels of a section.
struct PixelCensus {
  std::int64_t num_not_finite = 0;  ///< or beyond kLargestPixelValue
  std::int64_t num_bad = 0;         ///< hot or dead pixels
  std::int64_t num_masked = 0;      ///< left out by --mask
  std::int64_t is_constant = 1;     ///< 0 or 1, an integer as the other members, to be summed
};

/// Frames in which a view is wanted.
struct Frames {
  bool recorded = false;  ///< as the stack has it
  bool aligned = true;    ///< with the tilt axis along +Y through the centre
};

/// A view as stored intensities, binned; images that were not wanted are empty.
struct DecodedView {
  PixelCensus census;
  MaskedImage recorded;
  MaskedImage aligned;
};

/// Returns the bytes that decoding a view takes: its raw pixels, aligned and as they are, with
/// their masks, and what becomes of them.
std::size_t decoding_memory(double raw_pixels, double bin_factor);

/// Makes images of views from sections of a stack. Thread-safe.
class ViewDecoder {
 public:
  /// Opens the user's mask, if the options name one.
  explicit ViewDecoder(PlannedSeries series);

  /// From now on, decode() removes this pattern. No other thread may use the decoder meanwhile.
  void set_fixed_pattern(FixedPattern pattern) { pattern_ = std::move(pattern); }

  /// Reads the section of a view, masks what is no measurement (NaN, infinity, fill, the user's
  /// mask, hot and dead pixels), removes the fixed pattern, aligns and bins it. The view is added
  /// to `search` before its pattern is removed, unless that is null. Throws Error if the stack
  /// cannot be read.
  DecodedView decode(std::size_t view, Frames frames, PatternSearch* search = nullptr) const;

  /// Reads the section of a view and masks what is no measurement, as decode() does, and no more.
  MaskedImage read_masked(std::size_t view) const;

  /// Does the same as decode() with the values of one half of the frames. Masks and fixed pattern
  /// are those of all frames.
  DecodedView decode_half(Half half, const HalfStacks& halves, std::size_t view,
                          Frames frames) const;

 private:
  MaskedImage read_and_mask(std::size_t view, PixelCensus& census) const;
  DecodedView decode_masked(MaskedImage image, std::size_t view, Frames frames) const;
  MaskedImage aligned(MaskedImage recorded, std::size_t view) const;
  MaskedImage binned(MaskedImage image) const;

  PlannedSeries series_;
  std::optional<io::MrcReader> mask_;
  FixedPattern pattern_;
};

/// Returns the image of decode(frames) in the one frame in which the series is fitted.
template <typename Decode>
MaskedImage in_fitted_frame(const PlannedSeries& series, const Decode& decode) {
  const bool is_aligned = series.is_resampled();
  DecodedView view = decode(Frames{.recorded = !is_aligned, .aligned = is_aligned});
  return std::move(is_aligned ? view.aligned : view.recorded);
}

}  // namespace tomofield::tilt_series
