#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "geometry/view_warp.h"
#include "io/tables/imod_local.h"
#include "tilt_series/local/local_alignment.h"
#include "tilt_series/section_table.h"
#include "tilt_series/series_plan.h"

namespace tomofield::tilt_series {

/// The local alignment that a file of another program states: IMOD's (`options.local`), or
/// AreTomo's patch shifts.
class FileMotion {
 public:
  /// Reads the file. `pixel_size_A` and `aligned_size` are those of the aligned views before
  /// binning. Throws Error if the file is not of this stack. Warns of what is left out unless
  /// `options.applies_local`.
  FileMotion(const TiltSeriesOptions& options, const io::ImageStack& stack,
             const std::optional<SectionTable>& table, double pixel_size_A,
             const std::array<std::int64_t, 2>& aligned_size);

  /// Returns the local motion of a section's view, and adds the mean change of its tilt to the
  /// view. Nothing if the file states none.
  std::optional<geometry::ViewWarp> of(View& view);
  /// Says in the log what was applied, if anything.
  void report() const;

 private:
  std::optional<LocalPlace> place_of(View& view) const;

  std::string source_;
  std::optional<io::ImodLocal> imod_;
  const SectionTable* aretomo_ = nullptr;
  double scale_ = 1.0;  // pixels of the views for each of the IMOD file's
  double pixel_size_A_, width_px_, height_px_, raw_width_px_, raw_height_px_;
  int num_views_ = 0;
  double squares_px2_ = 0.0, left_over_px2_ = 0.0;
  double largest_stated_px_ = 0.0;
};

}  // namespace tomofield::tilt_series
