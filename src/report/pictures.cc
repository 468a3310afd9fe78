#include "report/pictures.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "base/statistics.h"
#include "base/threads/parallel.h"
#include "base/trace.h"
#include "field/sampling/sample_box.h"
#include "io/images/png.h"
#include "report/canvas.h"
#include "report/contrast.h"
#include "report/slice.h"
#include "report/trial_sections.h"

namespace tomofield::report {
namespace {

constexpr std::int64_t kMinMaskWidth_px = 512;
constexpr Colour kMasked{220, 60, 60};
constexpr Colour kFoundOnly{70, 120, 220};  // beads that are not masked
constexpr Colour kLeafBorder{255, 140, 0};
constexpr std::int64_t kPanelGap_px = 4;  // white pixels between panels of a held-out view

std::size_t lowest_tilt(const tilt_series::TiltSeries& series) {
  const auto& views = series.views();
  const auto lowest = std::min_element(views.begin(), views.end(),
                                       [](const tilt_series::View& a, const tilt_series::View& b) {
                                         return std::fabs(a.tilt_deg) < std::fabs(b.tilt_deg);
                                       });
  return static_cast<std::size_t>(lowest - views.begin());
}

/// Returns the greys of an image, the densest black. Masked pixels do not affect the scale.
std::vector<std::uint8_t> grey_values(const std::vector<float>& image,
                                      const std::vector<std::uint8_t>& valid) {
  std::vector<float> measured;
  for (std::size_t i = 0; i < image.size(); ++i)
    if (valid[i]) measured.push_back(image[i]);
  std::vector<std::uint8_t> grey(image.size());
  if (measured.empty()) return grey;
  const double low = base::percentile(measured, 0.5), high = base::percentile(measured, 99.5);
  const double scale = high > low ? 255.0 / (high - low) : 0.0;
  for (std::size_t i = 0; i < image.size(); ++i) {
    const double dark = std::clamp((high - static_cast<double>(image[i])) * scale, 0.0, 255.0);
    grey[i] = static_cast<std::uint8_t>(std::lround(dark));
  }
  return grey;
}

// Returns the slice at half the thickness, one voxel a pixel: [y, x].
std::vector<float> central_slice(const output::Model& model) {
  std::vector<float> slice = field::middle_plane(*model.field, model.roi);
  for (float& value : slice) value *= static_cast<float>(model.output_scale());
  return slice;
}

// Draws the lower x and y faces of a leaf. `zoom` is the picture pixels a pixel.
void draw_border(const field::Square& square, const Rectangle& roi, std::int64_t zoom,
                 Canvas& canvas) {
  const std::int64_t x0 = (square.x0 - roi.x0) * zoom, y0 = (square.y0 - roi.y0) * zoom;
  const std::int64_t size = square.size * zoom;
  canvas.fill(x0, y0, x0 + size, y0 + 1, kLeafBorder);
  canvas.fill(x0, y0, x0 + 1, y0 + size, kLeafBorder);
}

std::vector<float> residual_of(const measurement::PredictedView& view) {
  std::vector<float> residual(view.measured.size());
  for (std::size_t i = 0; i < residual.size(); ++i)
    residual[i] = view.measured[i] - view.predicted[i];
  return residual;
}

std::uint8_t grey_of(double value, double black, double range) {
  if (!std::isfinite(value) || !(range > 0)) return 0;
  return static_cast<std::uint8_t>(
      std::lround(std::clamp((value - black) / range, 0.0, 1.0) * 255.0));
}

// Returns what `with` has more than `without`, around the middle of the contrast of that: where
// nothing changes, it is a middle grey.
tune::Section difference_of(const tune::Section& with, const tune::Section& without) {
  tune::Section difference = with;
  const Contrast contrast = contrast_of(without.values);
  const auto middle = static_cast<float>((contrast.black + contrast.white) / 2);
  for (std::size_t i = 0; i < difference.values.size(); ++i)
    difference.values[i] += middle - without.values[i];
  return difference;
}

}  // namespace

void write_run_pictures(const std::filesystem::path& volume, const tilt_series::TiltSeries& series,
                        tilt_series::BeadMasking bead_masking, const output::OutputPaths& paths) {
  const base::TraceSpan span("draw pictures");
  base::parallel_for("draw pictures", 2, [&](std::int64_t i) {
    if (i == 0)
      write_slice_pictures(volume, paths.slice_pictures);
    else
      write_mask_picture(series, bead_masking, paths.mask_picture);
  });
}

void write_mask_picture(const tilt_series::TiltSeries& series,
                        tilt_series::BeadMasking bead_masking, const std::filesystem::path& path) {
  const std::int64_t width = series.width(), height = series.height();
  std::vector<float> image(static_cast<std::size_t>(width * height));
  std::vector<std::uint8_t> valid(image.size());
  series.read_view(lowest_tilt(series), image, valid);
  const std::vector<std::uint8_t> grey = grey_values(image, valid);
  const bool masks_beads = bead_masking == tilt_series::BeadMasking::kMasked;
  const Colour of_undecided = masks_beads ? kMasked : kFoundOnly;
  const std::int64_t zoom = std::max<std::int64_t>(1, (kMinMaskWidth_px + width - 1) / width);
  std::vector<std::uint8_t> pixels;
  pixels.reserve(static_cast<std::size_t>(width * height * zoom * zoom * 3));
  for (std::int64_t row = 0; row < height * zoom; ++row) {
    const std::int64_t y = height - 1 - row / zoom;  // the first row is at the bottom
    for (std::int64_t column = 0; column < width * zoom; ++column) {
      const auto at = static_cast<std::size_t>(y * width + column / zoom);
      const Colour colour = valid[at] == tilt_series::kNoMeasurement ? kMasked
                            : valid[at] == tilt_series::kUndecidedBead
                                ? of_undecided
                                : Colour{grey[at], grey[at], grey[at]};
      pixels.insert(pixels.end(), colour.begin(), colour.end());
    }
  }
  io::write_png_rgb(path, width * zoom, height * zoom, pixels);
}

void write_tree_picture(const output::Model& model, const std::filesystem::path& path) {
  const Rectangle& roi = model.roi;
  const std::vector<float> slice = central_slice(model);
  const GreyScale scale(contrast_of(slice));
  const std::int64_t zoom = picture_zoom(roi.width(), roi.width());
  Canvas canvas(roi.width() * zoom, roi.height() * zoom, {0, 0, 0});
  for (std::int64_t y = 0; y < roi.height(); ++y) {
    for (std::int64_t x = 0; x < roi.width(); ++x) {
      const std::uint8_t grey =
          scale.grey(static_cast<double>(slice[static_cast<std::size_t>(y * roi.width() + x)]));
      canvas.fill(x * zoom, y * zoom, (x + 1) * zoom, (y + 1) * zoom, {grey, grey, grey});
    }
  }
  const field::Quadtree& tree = model.field->tree();
  for (int leaf = 0; leaf < tree.num_leaves(); ++leaf)
    draw_border(tree.leaf(leaf).square, roi, zoom, canvas);
  canvas.write(path);
}

PlotAxes fsc_axes(double highest_frequency_per_A) {
  PlotAxes axes{.x_title = "resolution, Å",
                .y_title = "FSC",
                .x_range = {0, highest_frequency_per_A},
                .y_range = {-0.2, 1.05},
                .y_ticks = {{0.0, "0"}, {0.143, "0.143"}, {0.5, "0.5"}, {1.0, "1"}}};
  constexpr int kTicks = 6;
  for (int tick = 1; tick <= kTicks; ++tick) {
    const double frequency = highest_frequency_per_A * tick / kTicks;
    axes.x_ticks.push_back({frequency, fmt::format("{:.3g}", 1.0 / frequency)});
  }
  return axes;
}

Curve fsc_curve(std::string name, const std::vector<double>& frequency_per_A,
                const std::vector<double>& correlation) {
  Curve curve{std::move(name), {}};
  for (std::size_t shell = 0; shell < frequency_per_A.size(); ++shell)
    curve.points.emplace_back(frequency_per_A[shell], correlation[shell]);
  return curve;
}

void write_fsc_picture(const evaluate::Fsc& fsc, const std::filesystem::path& path) {
  const auto& frequency = fsc.frequency_per_A;
  std::vector<Curve> curves{fsc_curve("all", frequency, fsc.all.correlation)};
  if (fsc.measured) curves.push_back(fsc_curve("measured", frequency, fsc.measured->correlation));
  if (fsc.missing)
    curves.push_back(fsc_curve("missing wedge", frequency, fsc.missing->correlation));
  write_curve_plot(fsc_axes(frequency.back()), curves, path);
}

void write_held_out_picture(const measurement::PredictedView& view,
                            const std::filesystem::path& path) {
  std::vector<float> valid;
  for (const float value : view.measured)
    if (std::isfinite(value)) valid.push_back(value);
  const double black = valid.empty() ? 0.0 : base::percentile(valid, 0.5);
  const double range = valid.empty() ? 0.0 : base::percentile(valid, 99.5) - black;
  const struct {
    std::vector<float> values;
    double black;
  } panels[] = {{view.measured, black}, {view.predicted, black}, {residual_of(view), -range / 2}};

  const std::int64_t width = 3 * view.width + 2 * kPanelGap_px;
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(width * view.height), 255);
  for (std::int64_t panel = 0; panel < 3; ++panel) {
    for (std::int64_t y = 0; y < view.height; ++y) {
      const std::int64_t row = view.height - 1 - y;  // the first row is at the bottom
      for (std::int64_t x = 0; x < view.width; ++x) {
        const auto value =
            static_cast<double>(panels[panel].values[static_cast<std::size_t>(y * view.width + x)]);
        pixels[static_cast<std::size_t>(row * width + panel * (view.width + kPanelGap_px) + x)] =
            grey_of(value, panels[panel].black, range);
      }
    }
  }
  io::write_png_grey(path, width, view.height, pixels);
}

void write_prior_picture(const tune::TunedFit& tuned, double output_scale,
                         const std::filesystem::path& path) {
  std::vector<CaptionedSection> shown;
  if (!tuned.last_trials.empty() && !tuned.last_trials.front().section.values.empty()) {
    const tune::Section& without = tuned.last_trials.front().section;
    const tune::Section& with = tuned.last_trials.back().section;
    shown = {{without, "Total variation alone"},
             {with, "With the learned prior"},
             {difference_of(with, without), "What the prior adds"}};
  }
  draw_sections(shown, 0, output_scale, path);
}

}  // namespace tomofield::report
