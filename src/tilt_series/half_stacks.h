#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "io/images/image_stack.h"
#include "tilt_series/image.h"

namespace tomofield::tilt_series {

/// The two halves of a measurement: of the frames of each view, or of the tilts.
enum class Half { kEven, kOdd };
inline constexpr std::array kBothHalves{Half::kEven, Half::kOdd};

/// The stacks of both halves of the frames.
struct HalfPaths {
  std::filesystem::path even, odd;
};

/// Sums over the pixels of a section that are measurements in the stack of all frames. Values count
/// from their mean, so that the squares are variances.
struct HalfMoments {
  double n = 0;
  double all = 0, even = 0, odd = 0;  ///< means
  double all_squares = 0;             ///< Σ all²
  double sum_squares = 0;             ///< Σ (even + odd)²
  double products = 0;                ///< Σ all · (even + odd)
  double num_not_finite = 0;          ///< of these pixels, those that are not finite in a half
  double even_squares = 0, odd_squares = 0;  ///< Σ even², Σ odd²: 0 if a section is constant
  /// Numbers of pixels that differ between the halves, and between all frames and each half.
  double num_between = 0, num_even_apart = 0, num_odd_apart = 0;
};

/// The even and the odd frames of a series, as two stacks with the sections of the stack of all
/// frames, which is their sum, their mean, or another multiple of the sum.
///
/// A section of a half is read in the units of all frames: measured = gain · half + offset.
/// - Where the sections count electrons, the gain is the ratio of the means of both sections, and
///   the offset is 0. So the halves may have different numbers of frames. The stacks count as such
///   if all of their means are positive and above half a standard deviation, and those of the sums
///   agree with those of all frames within 5 %.
/// - Else the gain is twice the slope of all frames over the sum of the halves, of all sections
///   together, and the offset makes the means of both sections equal.
class HalfStacks {
 public:
  /// Opens both. Throws Error if one has not the size and the number of sections of `all`.
  HalfStacks(const HalfPaths& paths, const io::ImageStack& all);

  /// Measures a section beside that of all frames. Thread-safe.
  HalfMoments measure(std::int64_t section, const MaskedImage& all) const;
  /// Finds gains and offsets from the moments of `sections`. Throws Error if a half has pixels that
  /// are not finite or if the sum of the halves does not look like all frames. Warns if it does so
  /// only roughly.
  void match(std::span<const std::int64_t> sections, std::span<const HalfMoments> moments,
             const io::ImageStack& all);

  /// Reads a matched section in the units of all frames. Thread-safe.
  void read_section(Half half, std::int64_t section, std::span<float> out) const;

 private:
  struct Match {
    double gain = 1.0, offset = 0.0;
  };
  const io::ImageStack& stack(Half half) const { return *stacks_[static_cast<std::size_t>(half)]; }

  std::array<std::shared_ptr<const io::ImageStack>, 2> stacks_;  // [Half]
  std::map<std::int64_t, std::array<Match, 2>> matches_;         // of each section, [Half]
};

}  // namespace tomofield::tilt_series
