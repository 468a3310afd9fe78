#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace tomofield::kernels {

// Joseph's projector, line by line. A line is a row of samples along x (views
// up to 45°) or a column along z (steeper views); each sample is kLanes floats
// (the slab's detector rows). Detector pixel u of a view crosses the line at
//
//   position(u) = offset + step u        in samples of the line, |step| > 0
//
// and takes weight · hat(position(u) − j) of sample j, hat(t) = max(0, 1 − |t|).
// Pixels with position outside [low, high) or index outside
// [first_pixel, end_pixel) do not see the line. Forward and adjoint evaluate
// the same expression, so they are each other's exact transpose.

/// One line as one view sees it.
struct LineCrossing {
  /// For group_lines: sample 0. Samples −1 and num_samples must be readable (padding).
  const float* samples = nullptr;
  /// For group_views: pixel 0 of the view, [pixel, lane]. Pixel end_pixel must be readable: it is
  /// multiplied by 0.
  const float* detector = nullptr;
  float offset = 0, step = 1;
  float low = 0, high = 0;  ///< within [−1, num_samples]
  int first_pixel = 0, end_pixel = 0;
  float weight = 0;
};

/// Up to four crossings side by side, numbers by kind, arranged once for all tiles in which they
/// are used: lines that one view sees, or views that see one line.
struct CrossingGroup {
  static constexpr int kMost = 4;
  template <typename T>
  using Numbers = std::array<T, kMost>;
  /// [first, end), empty if the end is not after the first.
  struct Range {
    int first = 0, end = 0;
    bool is_empty() const { return end <= first; }
    bool contains(int from, int to) const { return from >= first && to <= end; }
    bool overlaps(int from, int to) const { return !is_empty() && from < end && to > first; }
    Range common_with(Range other) const {
      const Range common{std::max(first, other.first), std::min(end, other.end)};
      return common.is_empty() ? Range{} : common;
    }
    /// The least that has both.
    Range joined_with(Range other) const {
      if (is_empty()) return other;
      if (other.is_empty()) return *this;
      return {std::min(first, other.first), std::max(end, other.end)};
    }
  };

  alignas(16) Numbers<float> offset, step, low, high, first_pixel, last_pixel, weight;
  /// Of views, for sample j: the pair of pixel p = floor(inverse · j + bias) + skipped and p + 1.
  /// One pair reaches a sample if |step| >= 1, else more, which are crossings of their own.
  alignas(16) Numbers<float> inverse, bias, skipped;
  /// Sample 0 or pixel 0, in floats from where all sources are counted from.
  alignas(16) Numbers<int> origin;
  /// Pixels (lines) or samples (views) for which no crossing of the group has to be tested for
  /// its ends, and those outside of which none weighs anything.
  Range whole, reached;
};

/// Appends `lines` of one view, all of the same step and with a sample at least, to groups. Samples
/// are counted from `source` and begin within 2³¹ floats of it.
void group_lines(std::span<const LineCrossing> lines, const float* source,
                 std::vector<CrossingGroup>& groups);

/// Appends views of one line. Pixels are counted from `source`, likewise. Views with an empty
/// window are left out, and those with |step| < 1 become several items: how many groups there are
/// differs from line to line.
void group_views(std::span<const LineCrossing> views, const float* source,
                 std::vector<CrossingGroup>& groups);

/// Slabs that are treated together, one or two: they are crossed alike, so what a crossing's
/// indices and weights cost is paid once. Those of the second lie so many floats after the first's.
struct Slabs {
  int count = 1;
  std::ptrdiff_t samples_apart = 0, detectors_apart = 0;
};

/// detector[u, lane] += Σ_lines weight Σ_j hat(position(u) − j) samples_j[lane],
/// for pixels [first, end). All lines belong to one view: same detector, same step; their samples
/// are counted from `samples` and `stride` floats apart, and all lie within 2³¹.
/// Traffic a pixel and line: two cache lines of samples; the detector once for all lines.
void project_lines(const CrossingGroup* lines, int num_groups, const float* samples,
                   std::ptrdiff_t stride, int first, int end, float* detector,
                   const Slabs& slabs = {});

/// The adjoint: samples[j, lane] += Σ_views weight Σ_u hat(position_view(u) − j) detector_view[u,
/// lane] for samples j in [first, end), padding included. All views see one line; their pixels
/// are counted from `detector` and lie within 2³¹ floats. Traffic a sample and view: two cache
/// lines of the detector (more for |step| < 1); the sample once for all views.
void backproject_lines(const CrossingGroup* views, int num_groups, const float* detector,
                       std::ptrdiff_t stride, int first, int end, float* samples,
                       const Slabs& slabs = {});

}  // namespace tomofield::kernels
