#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "base/range.h"
#include "geometry/tilt_geometry.h"
#include "kernels/line_projection.h"
#include "projection/sample_grid.h"

namespace tomofield::projection {

/// The lines of a segment that one kind of view crosses: rows of z for flat views, columns of x for
/// steep ones.
struct LineFamily {
  bool flat;
  int num_lines, num_samples;
  std::ptrdiff_t origin, line_stride, sample_stride;
  bool cut_low, cut_high;  ///< the lines end at a face where another segment continues

  /// Returns the samples of a line with the padding that belongs to it, at cut faces.
  base::Range padded_samples() const {
    return {cut_low ? -1 : 0, num_samples + (cut_high ? 1 : 0)};
  }
};
LineFamily rows_of(const SampleSegment& segment);
LineFamily columns_of(const SampleSegment& segment);

/// Pixel u of a view crosses line l of a family at sample offset + l offset_per_line + u step.
struct Beam {
  double offset = 0, offset_per_line = 0, step = 1;
  float weight = 0;   ///< length of the piece of ray that a line represents, in pixels
  double spread = 0;  ///< number of samples that this piece of ray spans
};

/// A pixel whose piece of ray lies only in part on a line's side of a cut face. It takes the two
/// weights of samples `lower` and `lower` + 1.
struct PartialPixel {
  int line = 0;
  std::size_t view = 0;  ///< counted in the list of views
  int pixel = 0;
  std::ptrdiff_t lower = 0;
  float low_weight = 0, high_weight = 0;
};

/// What a list of views sees of some consecutive lines of a family.
struct LineBlock {
  static constexpr int kMaxLines = 8;
  struct View {
    std::size_t index = 0;  ///< in the list of views
    Beam beam;              ///< of line 0 of the family
    base::Range reached;    ///< pixels that see some line of the block
    std::vector<kernels::CrossingGroup> lines;
  };
  base::Range lines;
  std::vector<View> views;  ///< views of the family's kind, in order
  /// The views that see a line, grouped; one list a line.
  std::array<std::vector<kernels::CrossingGroup>, kMaxLines> views_of_line;
  std::vector<PartialPixel> parts;  ///< by lines, then by views
};

/// The places where the rays of a list of views cross the samples of a slab. They are the same for
/// all slabs of a grid, so they are made once for all of them.
class ViewCrossings {
 public:
  /// The lines of one kind of one segment.
  struct Lines {
    LineFamily family;
    std::vector<LineBlock> blocks;
  };
  /// Works on all threads.
  ViewCrossings(const geometry::TiltGeometry& geometry, const SampleGrid& grid,
                std::span<const int> views);

  std::size_t num_views() const { return num_views_; }
  const Lines& rows(std::size_t segment) const { return lines_[2 * segment]; }
  const Lines& columns(std::size_t segment) const { return lines_[2 * segment + 1]; }

 private:
  std::size_t num_views_;
  std::vector<Lines> lines_;  // [segment, rows and columns]
};

}  // namespace tomofield::projection
