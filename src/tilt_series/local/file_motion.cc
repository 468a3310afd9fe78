#include "tilt_series/local/file_motion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/log.h"

namespace tomofield::tilt_series {
namespace {

// Pixel sizes that differ by less are the same but for a calibration.
constexpr double kSamePixel = 0.05;

// No part of a specimen moves so far from where the alignment of its views finds it.
constexpr double kLargestMotion_A = 500.0;

// A series that is aligned is opened several times, and says this once.
void warn_of_what_is_left_out(const TiltSeriesOptions& options,
                              const std::optional<SectionTable>& table) {
  if (!options.corrections.empty() || !options.left_out.empty()) return;
  base::log_warning(fmt::format(
      "'{}' aligns parts of the views by themselves, which is left out with --align and with "
      "--engine ray",
      options.local ? options.local->string() : table->source));
}

}  // namespace

FileMotion::FileMotion(const TiltSeriesOptions& options, const io::ImageStack& stack,
                       const std::optional<SectionTable>& table, double pixel_size_A,
                       const std::array<std::int64_t, 2>& aligned_size)
    : pixel_size_A_(pixel_size_A),
      width_px_(static_cast<double>(aligned_size[0])),
      height_px_(static_cast<double>(aligned_size[1])),
      raw_width_px_(static_cast<double>(stack.header().nx)),
      raw_height_px_(static_cast<double>(stack.header().ny)) {
  const bool has_patches = table && !table->patches.empty();
  if (!options.applies_local) {
    if (options.local || has_patches) warn_of_what_is_left_out(options, table);
    return;
  }
  if (options.local) {
    source_ = options.local->string();
    imod_ = io::read_imod_local(*options.local, stack.header().nz);
    // The header's size tells the binning, also where another size is right.
    const double header_A = stack.header().voxel_size_A[0];
    const double ratio =
        imod_->pixel_size_A > 0 && header_A > 0 ? imod_->pixel_size_A / header_A : 1.0;
    if (std::abs(ratio - 1.0) > kSamePixel) scale_ = ratio;
  } else if (has_patches) {
    source_ = table->source;
    aretomo_ = &*table;
  }
}

std::optional<LocalPlace> FileMotion::place_of(View& view) const {
  if (imod_) {
    const ViewAngles stated{view.tilt_deg, view.x_tilt_deg};
    view.tilt_deg += mean_tilt_change_deg(*imod_, view.section);
    return place_of_imod(*imod_, view.section, stated, {view.tilt_deg, view.x_tilt_deg}, width_px_,
                         height_px_, scale_);
  }
  if (aretomo_ == nullptr) return std::nullopt;
  const auto at = static_cast<std::size_t>(view.section);
  const auto& patches = aretomo_->patches[at];
  if (patches.empty()) return std::nullopt;
  return place_of_aretomo(patches, aretomo_->of_section[at]->rotation_deg, raw_width_px_,
                          raw_height_px_);
}

std::optional<geometry::ViewWarp> FileMotion::of(View& view) {
  const auto place = place_of(view);
  if (!place) return std::nullopt;
  const FittedWarp fitted = warp_through(width_px_, height_px_, *place);
  ++num_views_;
  squares_px2_ += fitted.rms_px * fitted.rms_px;
  left_over_px2_ += fitted.left_over_px * fitted.left_over_px;
  largest_stated_px_ = std::max(largest_stated_px_, fitted.largest_stated_px);
  return fitted.warp;
}

void FileMotion::report() const {
  if (num_views_ == 0) return;
  base::log_info(fmt::format(
      "local alignment of '{}' in {} views: {:.2f} px (root mean square), at most {:.1f} px; the "
      "spline through 5 × 5 places leaves out {:.2f} px",
      source_, num_views_, std::sqrt(squares_px2_ / num_views_), largest_stated_px_,
      std::sqrt(left_over_px2_ / num_views_)));
  const double largest_A = largest_stated_px_ * pixel_size_A_;
  if (largest_A <= kLargestMotion_A) return;
  base::log_warning(
      fmt::format("the local alignment of '{}' moves parts of the views by up to {:.0f} px, "
                  "{:.0f} Å, which no specimen does: is it the one of this series?",
                  source_, largest_stated_px_, largest_A));
}

}  // namespace tomofield::tilt_series
