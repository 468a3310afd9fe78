#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "distributed/communicator.h"
#include "tilt_series/fixed_pattern/fixed_pattern.h"
#include "tilt_series/fixed_pattern/line_pattern.h"
#include "tilt_series/fixed_pattern/pixel_pattern.h"
#include "tilt_series/series_plan.h"

namespace tomofield::tilt_series {

/// Looks for a fixed pattern in the views of a series, before they are aligned. Every process adds
/// the views that it owns (own_views.h).
class PatternSearch {
 public:
  static constexpr std::size_t kFewestViews = 8;

  /// There are `num_views`, at least kFewestViews.
  PatternSearch(std::size_t num_views, std::int64_t width, std::int64_t height);

  /// Takes in a view as recorded, unbinned. Different threads may add different views at once.
  void add(std::size_t view, const MaskedImage& image);

  /// Returns the pattern. All processes must call.
  ///
  /// Lines along the tilt axis are compared between low, middle and high tilts. Lines across the
  /// axis see the same specimen at all tilts. They have a pattern only if the alignment shifts the
  /// views along the axis, and are compared between views that it shifts by little and by much.
  FixedPattern find(const SeriesPlan& plan, const distributed::Communicator& processes);

 private:
  struct Profiles {
    Lines lines;
    std::int64_t num_lines;
    std::vector<LineProfiles> of_view;  ///< empty of views that were not added
  };
  std::vector<std::vector<float>> find_lines(Profiles* profiles, const SeriesPlan& plan,
                                             const distributed::Communicator& processes) const;

  Profiles columns_, rows_;
  PixelPattern pixels_;
};

}  // namespace tomofield::tilt_series
