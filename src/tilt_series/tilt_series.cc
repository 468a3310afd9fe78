#include "tilt_series/tilt_series.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/check.h"
#include "tilt_series/resampling/align_image.h"
#include "tilt_series/survey.h"

namespace tomofield::tilt_series {
namespace {

void copy_parts(const MaskedImage& from, std::span<float> image, std::span<std::uint8_t> valid) {
  TOMOFIELD_CHECK(image.size() == from.values.size() && valid.size() == image.size(),
                  "image and mask must have width × height elements");
  std::ranges::copy(from.values, image.begin());
  std::ranges::copy(from.valid, valid.begin());
}

}  // namespace

TiltSeries::TiltSeries(const TiltSeriesOptions& options, const distributed::Communicator& processes)
    : TiltSeries(survey_views(PlannedSeries(options, processes), processes)) {}
TiltSeries::TiltSeries(SurveyedViews surveyed)
    : MeasuredSeries(std::make_unique<const Survey>(std::move(surveyed.survey))),
      views_(std::move(surveyed.views)) {}
TiltSeries::~TiltSeries() = default;
TiltSeries::TiltSeries(TiltSeries&&) noexcept = default;

std::vector<std::vector<BeadSpot>> TiltSeries::find_bead_spots(
    std::span<const geometry::ViewCorrection> corrections, double axis_x_px,
    const distributed::Communicator& processes) const {
  TOMOFIELD_CHECK(!is_resampled() && corrections.size() == views().size(),
                  "beads are looked for in views as recorded, each with a correction");
  if (!searches_beads(options())) return {};
  const auto read = [&](std::size_t view) {
    const RawFromAligned transform =
        geometry::corrected(raw_from_aligned(view), corrections[view].binned(bin_factor()));
    MaskedImage image = stored_or_decoded(view);
    survey().intensity.convert(&image);
    return align_image(image, transform, aligned_width(), aligned_height());
  };
  BeadViews bead_views = survey().bead_views(processes, read);
  bead_views.axis_x_px = axis_x_px;
  for (std::size_t view = 0; view < corrections.size(); ++view)
    bead_views.tilt_deg[view] += corrections[view].tilt_deg;
  return search_beads(options(), plan(), bead_views, processes).spots;
}

// Returns a view in the frame that the options ask for, as stored intensities.
MaskedImage TiltSeries::stored_or_decoded(std::size_t view) const {
  return views_->holds(view) ? views_->read(view) : survey().decode(view);
}

void TiltSeries::read_view(std::size_t view, std::span<float> image, std::span<std::uint8_t> valid,
                           const microscope::ViewTransfer* transfer) const {
  TOMOFIELD_CHECK(view < views().size(), fmt::format("there is no view {}", view));
  copy_parts(survey().line_integrals(stored_or_decoded(view), view, transfer), image, valid);
}

void TiltSeries::read_half(Half half, std::size_t view, std::span<float> image,
                           std::span<std::uint8_t> valid,
                           const microscope::ViewTransfer* transfer) const {
  TOMOFIELD_CHECK(survey().halves.has_value(), "the options name no halves");
  copy_parts(survey().line_integrals(survey().decode(half, view), view, transfer), image, valid);
}

void TiltSeries::forget_view(std::size_t view) const {
  if (views_->holds(view)) views_->discard(view);
}

}  // namespace tomofield::tilt_series
