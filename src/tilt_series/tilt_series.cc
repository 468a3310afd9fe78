#include "tilt_series/tilt_series.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <utility>

#include "base/check.h"
#include "base/log.h"
#include "io/mrc.h"
#include "tilt_series/align_image.h"
#include "tilt_series/binning.h"
#include "tilt_series/masks/bad_pixels.h"
#include "tilt_series/masks/flat_fill.h"
#include "tilt_series/masks/series_masks.h"
#include "tilt_series/noise.h"
#include "tilt_series/series_plan.h"
#include "tomofield/error.h"

namespace tomofield::tilt_series {
namespace {

/// What is wrong with the raw pixels of a section.
struct PixelCensus {
  std::int64_t num_not_finite = 0;
  std::int64_t num_bad = 0;           // hot or dead
  std::int64_t is_constant = 1;       // 0 or 1: all numbers, to be sent
  std::int64_t has_measurements = 0;  // pixels that are left
};

/// Marks pixels that are NaN or infinite as no measurements.
PixelCensus mask_not_finite(MaskedImage* image) {
  PixelCensus census;
  const float* first_finite = nullptr;
  for (std::size_t i = 0; i < image->values.size(); ++i) {
    if (!std::isfinite(image->values[i])) {
      image->valid[i] = 0;
      image->values[i] = 0.0f;
      ++census.num_not_finite;
      continue;
    }
    if (first_finite == nullptr) first_finite = &image->values[i];
    if (image->values[i] != *first_finite) census.is_constant = 0;
  }
  return census;
}

/// Means of square blocks of valid pixels, appended to `means`. They are much
/// less noisy than pixels, so that a high percentile of them is an intensity
/// of the specimen's thinnest places and not of the noise.
void append_block_means(const MaskedImage& image, std::vector<float>* means) {
  constexpr std::int64_t kLargestBlock = 8;
  const std::int64_t block =
      std::clamp<std::int64_t>(std::min(image.width, image.height) / 32, 1, kLargestBlock);
  const MaskedImage blocks = reduce_image(image, static_cast<double>(block));
  for (std::size_t i = 0; i < blocks.values.size(); ++i) {
    if (blocks.valid[i]) means->push_back(blocks.values[i]);
  }
}

/// Values of every view, of which each process has some, one view after another on all.
std::vector<float> gather(const std::vector<std::vector<float>>& views,
                          const distributed::Communicator& processes) {
  std::vector<std::int64_t> sizes;
  for (const auto& values : views) sizes.push_back(std::ssize(values));
  processes.allreduce_sum(std::span(sizes));
  std::vector<float> all(
      static_cast<std::size_t>(std::accumulate(sizes.begin(), sizes.end(), std::int64_t{0})));
  auto at = all.begin();
  for (std::size_t view = 0; view < views.size(); at += sizes[view++])
    std::ranges::copy(views[view], at);
  processes.allreduce_sum(std::span(all));
  return all;
}

double percentile_in_place(std::vector<float>& values, double fraction) {
  const auto rank =
      static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[static_cast<std::size_t>(rank)];
}

// I0 is this percentile of the block means of all views together: the thinnest
// half per cent of what was seen, beyond the reach of single hot pixels.
constexpr double kEmptyBeamFraction = 0.995;

// Intensities below this part of I0 are raised to it before the logarithm: a
// transmission so low is never measured, it comes from noise and subtraction.
constexpr double kLogFloor = 1e-3;

constexpr double kMostNotFinite = 0.01;

}  // namespace

struct TiltSeries::Impl {
  TiltSeriesOptions options;
  io::MrcReader stack;
  std::optional<io::MrcReader> mask;
  SeriesPlan plan;
  std::vector<View> views;
  std::int64_t width = 0;
  std::int64_t height = 0;
  double empty_beam = 0.0;
  std::vector<double> noise_sigma;
  BeadMasks beads;  // none while they are looked for

  explicit Impl(const TiltSeriesOptions& given)
      : options(given), stack(given.stack), plan(plan_series(given, stack)) {
    if (options.mask) mask.emplace(open_mask(*options.mask, stack));
    for (const PlannedView& planned : plan.views) views.push_back(planned.view);
    beads.discs.resize(views.size());
    const io::MrcHeader& header = stack.header();
    width = reduced_size(options.resample ? plan.aligned_width : header.nx, plan.bin_factor);
    height = reduced_size(options.resample ? plan.aligned_height : header.ny, plan.bin_factor);
  }

  /// Reads every view and says what was found.
  void look_over(const distributed::Communicator& processes) {
    survey(processes);
    processes.run_collectively([&] { find_beads(); });
    base::log_info(
        fmt::format("'{}': {} of {} sections, tilts {:.1f}° to {:.1f}° from {}, views of {} × {} "
                    "pixels of {:.6g} Å",
                    options.stack.string(), views.size(), stack.header().nz,
                    std::min_element(views.begin(), views.end(), by_tilt)->tilt_deg,
                    std::max_element(views.begin(), views.end(), by_tilt)->tilt_deg,
                    plan.angle_source, width, height, plan.pixel_size_A * plan.bin_factor));
  }

  static bool by_tilt(const View& a, const View& b) { return a.tilt_deg < b.tilt_deg; }

  std::string describe(std::size_t view) const {
    return fmt::format("section {} (tilt {}°) of '{}'", views[view].section + 1,
                       views[view].tilt_deg, options.stack.string());
  }

  /// The binned intensities of a view, as stored, in the frame that the options ask for.
  MaskedImage load(std::size_t view, PixelCensus* census) const {
    return load(view, options.resample, census);
  }

  MaskedImage load(std::size_t view, bool aligned, PixelCensus* census) const {
    const io::MrcHeader& header = stack.header();
    MaskedImage image(header.nx, header.ny);
    stack.read_section(views[view].section, image.values);
    *census = mask_not_finite(&image);
    if (!plan.is_raw) mask_flat_fill(options.contrast, &image);
    if (mask) apply_mask(*mask, views[view].section, &image);
    census->num_bad = mask_bad_pixels(&image);
    const RawFromAligned& transform = plan.views[view].raw_from_aligned;
    const bool keeps_sizes = plan.aligned_width == header.nx && plan.aligned_height == header.ny;
    if (aligned && !(transform.is_identity() && keeps_sizes)) {
      image = align_image(image, transform, plan.aligned_width, plan.aligned_height);
    }
    if (plan.bin_factor != 1.0) image = reduce_image(image, plan.bin_factor);
    mask_discs(beads.discs[view], &image);
    return image;
  }

  /// Intensities to line integrals; returns how many pixels the floor raised.
  std::int64_t convert(MaskedImage* image) const {
    if (options.contrast == Contrast::kBright) return 0;
    std::int64_t num_raised = 0;
    for (std::size_t i = 0; i < image->values.size(); ++i) {
      if (!image->valid[i]) continue;
      float& value = image->values[i];
      if (!options.take_log) {
        value = static_cast<float>(empty_beam - value);
        continue;
      }
      const double transmission = value / empty_beam;
      if (transmission < kLogFloor) ++num_raised;
      value = static_cast<float>(-std::log(std::max(transmission, kLogFloor)));
    }
    return num_raised;
  }

  void require_measurements(std::size_t view, const PixelCensus& census) const {
    const auto num_pixels = static_cast<double>(stack.header().nx * stack.header().ny);
    const double part = static_cast<double>(census.num_not_finite) / num_pixels;
    if (part > kMostNotFinite) {
      throw Error(fmt::format(
          "{} has {} NaN or infinite pixels, {:.1f} % of all and more than the "
          "1 % that can be left out; repair it or give --exclude {}",
          describe(view), census.num_not_finite, 100.0 * part, views[view].section + 1));
    }
    if (census.is_constant) {
      throw Error(
          fmt::format("{} is constant: every pixel has the same value; leave it out with "
                      "--exclude {}",
                      describe(view), views[view].section + 1));
    }
    if (!census.has_measurements) {
      throw Error(
          fmt::format("{} has no pixel left: its alignment moves it out of the view, it is all "
                      "flat fill, or --mask is zero all over it; leave it out with --exclude {}",
                      describe(view), views[view].section + 1));
    }
    if (census.num_not_finite > 0) {
      base::log_warning(fmt::format("{} has {} NaN or infinite pixels, which are left out",
                                    describe(view), census.num_not_finite));
    }
  }

  /// Reads every view once: refuses what cannot be used, finds I0 and the
  /// noise. The noise of I0 − I is that of I; only a logarithm needs I0 first.
  void survey(const distributed::Communicator& processes) {
    std::vector<PixelCensus> found(views.size());
    std::vector<std::vector<float>> means(views.size());
    noise_sigma.assign(views.size(), 0.0);
    for_own_views(processes, [&](std::size_t view) {
      const MaskedImage image = load(view, &found[view]);
      found[view].has_measurements =
          std::find(image.valid.begin(), image.valid.end(), 1) != image.valid.end();
      if (options.contrast == Contrast::kDark) append_block_means(image, &means[view]);
      if (!options.take_log && found[view].has_measurements)
        noise_sigma[view] = estimate_noise_sigma(image);
    });
    check(std::move(found), processes);
    processes.allreduce_sum(std::span(noise_sigma));
    if (options.contrast == Contrast::kBright) return;
    std::vector<float> block_means = gather(means, processes);
    if (!block_means.empty()) empty_beam = percentile_in_place(block_means, kEmptyBeamFraction);
    if (options.take_log) survey_logarithms(processes);
  }

  /// Calls body(view) on one of the processes for each view.
  template <typename Body>
  void for_own_views(const distributed::Communicator& processes, const Body& body) const {
    processes.run_collectively([&] {
      for (std::size_t view = static_cast<std::size_t>(processes.rank()); view < views.size();
           view += static_cast<std::size_t>(processes.size()))
        body(view);
    });
  }

  /// What every process found in its views: of others, `is_constant` is as it begins.
  void check(std::vector<PixelCensus> found, const distributed::Communicator& processes) {
    for (std::size_t view = 0; view < views.size(); ++view) {
      if (static_cast<int>(view) % processes.size() != processes.rank())
        found[view].is_constant = 0;
    }
    processes.allreduce_sum(std::span(found), &PixelCensus::num_not_finite, &PixelCensus::num_bad,
                            &PixelCensus::is_constant, &PixelCensus::has_measurements);
    processes.run_collectively([&] {
      for (std::size_t view = 0; view < views.size(); ++view) {
        require_measurements(view, found[view]);
        beads.metrics.num_bad_pixels += found[view].num_bad;
      }
    });
  }

  /// Finds what hides beads and fiducials, in aligned images that have no such masks yet.
  void find_beads() {
    BeadViews bead_views;
    for (const View& view : views) bead_views.tilt_deg.push_back(view.tilt_deg);
    bead_views.read = [this](std::size_t view) {
      PixelCensus census;
      MaskedImage image = load(view, /*aligned=*/true, &census);
      convert(&image);
      return image;
    };
    const std::int64_t num_bad_pixels = beads.metrics.num_bad_pixels;
    beads = find_bead_masks(options, plan, stack, bead_views);
    beads.metrics.num_bad_pixels = num_bad_pixels;
    if (options.resample) return;
    for (std::size_t view = 0; view < views.size(); ++view) {
      for (MaskDisc& disc : beads.discs[view]) disc = as_recorded(disc, view);
    }
  }

  /// A disc of an aligned, binned view in the view as it was recorded.
  MaskDisc as_recorded(const MaskDisc& disc, std::size_t view) const {
    const RawFromAligned m = plan.views[view].raw_from_aligned.binned(plan.bin_factor);
    const auto middle = [&](std::int64_t size) {
      return static_cast<double>(reduced_size(size, plan.bin_factor)) / 2;
    };
    const double x = disc.x_px - middle(plan.aligned_width);
    const double y = disc.y_px - middle(plan.aligned_height);
    return {m.m11 * x + m.m12 * y + m.shift_x_px + static_cast<double>(width) / 2,
            m.m21 * x + m.m22 * y + m.shift_y_px + static_cast<double>(height) / 2,
            disc.radius_px * std::sqrt(std::abs(m.m11 * m.m22 - m.m12 * m.m21))};
  }

  void survey_logarithms(const distributed::Communicator& processes) {
    if (!(empty_beam > 0.0)) {
      throw distributed::SharedError(
          fmt::format("--log needs positive intensities, but the empty beam of '{}' is "
                      "found at {}; the data may be normalised or line integrals already: "
                      "leave --log out",
                      options.stack.string(), empty_beam));
    }
    std::int64_t num_raised = 0;
    for_own_views(processes, [&](std::size_t view) {
      PixelCensus census;
      MaskedImage image = load(view, &census);
      num_raised += convert(&image);
      noise_sigma[view] = estimate_noise_sigma(image);
    });
    processes.allreduce_sum(std::span(noise_sigma));
    processes.allreduce_sum(std::span(&num_raised, 1));
    if (num_raised == 0) return;
    base::log_warning(fmt::format(
        "{} pixels of '{}' ({:.3g} %) are zero, negative or below a thousandth of the empty beam "
        "({}); they are raised to it before the logarithm",
        num_raised, options.stack.string(),
        100.0 * static_cast<double>(num_raised) /
            static_cast<double>(width * height * static_cast<std::int64_t>(views.size())),
        empty_beam));
  }
};

TiltSeries::TiltSeries(const TiltSeriesOptions& options,
                       const distributed::Communicator& processes) {
  processes.run_collectively([&] { impl_ = std::make_unique<Impl>(options); });
  impl_->look_over(processes);
}
TiltSeries::~TiltSeries() = default;
TiltSeries::TiltSeries(TiltSeries&&) noexcept = default;

const std::vector<View>& TiltSeries::views() const { return impl_->views; }
std::int64_t TiltSeries::width() const { return impl_->width; }
std::int64_t TiltSeries::height() const { return impl_->height; }
std::int64_t TiltSeries::aligned_width() const {
  return reduced_size(impl_->plan.aligned_width, bin_factor());
}
std::int64_t TiltSeries::aligned_height() const {
  return reduced_size(impl_->plan.aligned_height, bin_factor());
}
bool TiltSeries::is_resampled() const { return impl_->options.resample; }
geometry::RawFromAligned TiltSeries::raw_from_aligned(std::size_t view) const {
  return impl_->plan.views[view].raw_from_aligned.binned(bin_factor());
}
double TiltSeries::pixel_size_A() const { return impl_->plan.pixel_size_A * bin_factor(); }
double TiltSeries::bin_factor() const { return impl_->plan.bin_factor; }
const std::vector<double>& TiltSeries::noise_sigma() const { return impl_->noise_sigma; }
double TiltSeries::empty_beam() const { return impl_->empty_beam; }
const MaskMetrics& TiltSeries::mask_metrics() const { return impl_->beads.metrics; }

void TiltSeries::read_view(std::size_t view, std::span<float> image,
                           std::span<std::uint8_t> valid) const {
  TOMOFIELD_CHECK(view < impl_->views.size(), fmt::format("there is no view {}", view));
  TOMOFIELD_CHECK(
      image.size() == static_cast<std::size_t>(width() * height()) && valid.size() == image.size(),
      "image and mask must have width × height elements");
  PixelCensus census;
  MaskedImage loaded = impl_->load(view, &census);
  impl_->convert(&loaded);
  std::copy(loaded.values.begin(), loaded.values.end(), image.begin());
  std::copy(loaded.valid.begin(), loaded.valid.end(), valid.begin());
}

}  // namespace tomofield::tilt_series
