#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "base/range.h"

namespace tomofield::kernels {

// Joseph's projector, line by line. A line is a row of samples along x (views up to 45°) or a
// column along z (steeper views). Each sample is kLanes floats, one for each detector row of the
// slab. Detector pixel u of a view crosses the line at
//
//   position(u) = offset + step u        in samples of the line, |step| > 0
//
// and takes weight · hat(position(u) − j) of sample j, with hat(t) = max(0, 1 − |t|). Pixels do not
// see the line if their position is outside [low, high) or their index outside
// [first_pixel, end_pixel). Forward and adjoint evaluate the same expression, so they are exact
// transposes of each other.

/// One line as seen by one view.
struct LineCrossing {
  /// Points to sample 0, for group_lines. Samples −1 and num_samples must be readable (padding).
  const float* samples = nullptr;
  /// Points to pixel 0 of the view, [pixel, lane], for group_views. Pixel end_pixel must be
  /// readable: it is multiplied by 0.
  const float* detector = nullptr;
  float offset = 0, step = 1;
  float low = 0, high = 0;  ///< within [−1, num_samples]
  int first_pixel = 0, end_pixel = 0;
  float weight = 0;
};

/// Up to four crossings as a structure of arrays: lines that one view sees, or views that see one
/// line. A group is made once and serves all tiles.
struct CrossingGroup {
  static constexpr int kMax = 4;
  template <typename T>
  using Numbers = std::array<T, kMax>;

  alignas(16) Numbers<float> offset, step, low, high, first_pixel, last_pixel, weight;
  /// The other numbers are for views. Sample j takes from pixel p = floor(inverse · j + bias) +
  /// skipped and from p + 1. One such pair of pixels reaches a sample if |step| >= 1; otherwise
  /// several do, and each is a crossing of its own.
  alignas(16) Numbers<float> inverse, bias, skipped;
  /// The position of sample 0 or pixel 0, in floats from the common source.
  alignas(16) Numbers<int> origin;
  /// `whole` are the pixels (for lines) or samples (for views) for which no crossing of the group
  /// needs a test of its ends. Outside of `reached`, no crossing has any weight.
  base::Range whole, reached;
};

/// Appends `lines` of one view to groups. All have the same step and at least one sample. Samples
/// are counted from `source` and begin within 2³¹ floats of it.
void group_lines(std::span<const LineCrossing> lines, const float* source,
                 std::vector<CrossingGroup>& groups);

/// Appends views of one line to groups. Pixels are counted from `source` and begin within 2³¹
/// floats of it. Views with an empty window are left out, and those with |step| < 1 become several
/// crossings, so the number of groups differs from line to line.
void group_views(std::span<const LineCrossing> views, const float* source,
                 std::vector<CrossingGroup>& groups);

/// One or two slabs that are processed together. They have the same crossings, so the indices and
/// weights are computed once. `samples_apart` and `detectors_apart` are the distances in floats
/// from the first slab's arrays to the second's.
struct SlabGroup {
  int count = 1;
  std::ptrdiff_t samples_apart = 0, detectors_apart = 0;
};

/// Projects lines: detector[u, lane] += Σ_lines weight Σ_j hat(position(u) − j) samples_j[lane] for
/// pixels u in [first, end). All lines belong to one view, with the same detector and step. Their
/// samples are counted from `samples`, are `stride` floats apart, and lie within 2³¹ floats. Memory
/// traffic a pixel and line: two cache lines of samples; the detector once for all lines.
void project_lines(const CrossingGroup* lines, int num_groups, const float* samples,
                   std::ptrdiff_t stride, int first, int end, float* detector,
                   const SlabGroup& slabs = {});

/// Applies the adjoint: samples[j, lane] += Σ_views weight Σ_u hat(position_view(u) − j)
/// detector_view[u, lane] for samples j in [first, end), padding included. All views see one line.
/// Their pixels are counted from `detector` and lie within 2³¹ floats. Memory traffic a sample and
/// view: two cache lines of the detector (more for |step| < 1); the sample once for all views.
void backproject_lines(const CrossingGroup* views, int num_groups, const float* detector,
                       std::ptrdiff_t stride, int first, int end, float* samples,
                       const SlabGroup& slabs = {});

}  // namespace tomofield::kernels
