#include "tilt_series/tilt_series.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <span>
#include <string>
#include <utility>

#include "base/check.h"
#include "base/log.h"
#include "base/trace.h"
#include "io/images/image_stack.h"
#include "io/images/mrc.h"
#include "io/saving/scratch_memory.h"
#include "tilt_series/decode_view.h"
#include "tilt_series/fixed_pattern/fixed_pattern.h"
#include "tilt_series/fixed_pattern/pattern_search.h"
#include "tilt_series/half_stacks.h"
#include "tilt_series/intensity.h"
#include "tilt_series/masks/series_masks.h"
#include "tilt_series/masks/subtract_beads.h"
#include "tilt_series/noise.h"
#include "tilt_series/open_views.h"
#include "tilt_series/resampling/align_image.h"
#include "tilt_series/series_plan.h"
#include "tilt_series/view_check.h"
#include "tilt_series/view_owner.h"
#include "tilt_series/view_store.h"
#include "tilt_series/views_at_once.h"
#include "tomofield/error.h"

namespace tomofield::tilt_series {
namespace {

bool has_lower_tilt(const View& a, const View& b) { return a.tilt_deg < b.tilt_deg; }

// Says whether a part of the contrast is that of phases, whose transfer puts fringes around beads.
// Optics without it (microscope::without_phase_contrast()) are those of pure absorption.
bool has_phase_contrast(const microscope::Optics& optics) { return optics.amplitude_contrast < 1; }

std::optional<io::MrcReader> open_mask_of(const TiltSeriesOptions& options,
                                          const io::ImageStack& stack) {
  if (!options.mask) return std::nullopt;
  return open_mask(*options.mask, stack);
}

}  // namespace

struct TiltSeries::Impl {
  TiltSeriesOptions options;
  std::shared_ptr<const io::ImageStack> stack;
  SeriesPlan plan;
  ViewDecoder decoder;
  std::vector<View> views;
  std::int64_t width, height;
  IntensityScale intensity;
  double background = 0.0;
  std::vector<double> noise_sigma;
  std::int64_t num_bad_pixels = 0;
  FixedPatternMetrics fixed_pattern;
  BeadMasks beads;  // without discs until they have been found
  std::optional<HalfStacks> halves;

  // Decoded views of this process, as stored intensities without discs of beads.
  std::unique_ptr<ViewStore> measured;  // in the frame that the options ask for
  std::unique_ptr<ViewStore> aligned;   // for the search for beads, where `measured` is not aligned

  explicit Impl(const TiltSeriesOptions& given)
      : options(given),
        stack(open_views(given)),
        plan(plan_series(given, *stack)),
        decoder(*stack, plan, given.contrast, open_mask_of(given, *stack)),
        width(given.resample ? decoder.aligned_width() : decoder.recorded_width()),
        height(given.resample ? decoder.aligned_height() : decoder.recorded_height()),
        intensity{given.contrast, given.take_log, 0.0, given.black_level.value_or(0.0),
                  given.log_base} {
    for (const PlannedView& planned : plan.views) views.push_back(planned.view);
    beads.discs.resize(views.size());
    beads.undecided.resize(views.size());
    if (options.even && options.odd) halves.emplace(HalfPaths{*options.even, *options.odd}, *stack);
  }

  /// Decodes every view, checks and measures it.
  void look_over(const distributed::Communicator& processes) {
    decode_views(processes);
    if (halves) match_halves(processes);
    if (options.take_log) measure_logarithms(processes);
    find_beads(processes);
    measure_noise_beside_beads(processes);
    if (!options.keep_views) measured.reset();
    log_series();
  }

  // --------------------------------------------------------------- decoding

  bool stores_measured() const {
    return options.keep_views || options.take_log || (options.resample && searches_beads(options));
  }
  bool stores_aligned() const { return !options.resample && searches_beads(options); }

  void make_stores(const distributed::Communicator& processes) {
    const std::size_t capacity = max_own_views(views.size(), processes);
    const std::filesystem::path dir =
        options.scratch_dir.empty() ? io::scratch_directory({}) : options.scratch_dir;
    const auto make = [&](std::int64_t view_width, std::int64_t view_height) {
      return std::make_unique<ViewStore>(views.size(), capacity, view_width, view_height, dir);
    };
    measured.reset();
    aligned.reset();
    processes.run_collectively([&] {
      if (stores_measured()) measured = make(width, height);
      if (stores_aligned()) aligned = make(decoder.aligned_width(), decoder.aligned_height());
    });
  }

  /// Calls body(view) on all threads for each view that this process owns.
  template <typename Body>
  void for_own_views(const char* what, const distributed::Communicator& processes,
                     const Body& body) const {
    std::vector<std::size_t> own;
    for (std::size_t view = 0; view < views.size(); ++view)
      if (is_own_view(view, processes)) own.push_back(view);
    const std::size_t at_once = views_at_once(decoder.memory(), processes);
    processes.run_collectively([&] { for_views(what, own, at_once, body); });
  }

  /// Decodes every view, and once more without a fixed pattern if they have one.
  void decode_views(const distributed::Communicator& processes) {
    const bool searches =
        options.remove_fixed_pattern && views.size() >= PatternSearch::kFewestViews;
    std::optional<PatternSearch> search;
    if (searches) search.emplace(views.size(), stack->header().nx, stack->header().ny);
    check(decode_once(searches ? &*search : nullptr, processes), processes);
    if (!searches) return;
    FixedPattern pattern = search->find(plan, processes);
    if (pattern.is_empty()) return;
    search.reset();
    fixed_pattern = measure_pattern(pattern);
    decoder.set_fixed_pattern(std::move(pattern));
    decode_once(nullptr, processes);
  }

  /// Decodes every view: stores it, finds I0 and the noise, and adds it to `search`, if there is
  /// one. The noise of I0 − I is that of I; only logarithms need I0 first.
  std::vector<ViewCheck> decode_once(PatternSearch* search,
                                     const distributed::Communicator& processes) {
    make_stores(processes);
    std::vector<ViewCheck> checks(views.size());
    std::vector<std::vector<float>> block_means(views.size());
    noise_sigma.assign(views.size(), 0.0);
    const base::TraceSpan span("decode views");
    for_own_views("decode views", processes, [&](std::size_t view) {
      const DecodedView decoded = decoder.decode(
          view, {.recorded = !options.resample, .aligned = options.resample || aligned != nullptr},
          search);
      const MaskedImage& image = options.resample ? decoded.aligned : decoded.recorded;
      if (measured) measured->write(view, image);
      if (aligned) aligned->write(view, decoded.aligned);
      checks[view] = check_view(decoded.census, image);
      append_block_means(image, &block_means[view]);
      if (!options.take_log && checks[view].has_measurements)
        noise_sigma[view] = estimate_noise_sigma(image);
    });
    processes.allreduce_sum(std::span(noise_sigma));
    if (options.contrast == Contrast::kDark)
      intensity.empty_beam = estimate_empty_beam(block_means, processes);
    else
      background = estimate_background(block_means, processes) - options.black_level.value_or(0.0);
    return checks;
  }

  // --------------------------------------------------------------- checking

  std::string describe(std::size_t view) const {
    return fmt::format("section {} (tilt {}°) of '{}'", views[view].section + 1,
                       views[view].tilt_deg, stack->name());
  }

  /// Shares what each process found in its views, and refuses what cannot be used.
  void check(std::vector<ViewCheck> checks, const distributed::Communicator& processes) {
    processes.allreduce_sum(std::span(checks), &ViewCheck::num_not_finite, &ViewCheck::num_bad,
                            &ViewCheck::is_constant, &ViewCheck::has_measurements);
    processes.run_collectively([&] {
      for (std::size_t view = 0; view < views.size(); ++view) {
        require_usable(checks[view], describe(view), views[view].section + 1,
                       stack->header().nx * stack->header().ny);
        num_bad_pixels += checks[view].num_bad;
      }
    });
  }

  void log_series() const {
    base::log_info(
        fmt::format("'{}': {} of {} sections, tilts {:.1f}° to {:.1f}° from {}, views of {} × {} "
                    "pixels of {:.6g} Å",
                    stack->name(), views.size(), stack->header().nz,
                    std::min_element(views.begin(), views.end(), has_lower_tilt)->tilt_deg,
                    std::max_element(views.begin(), views.end(), has_lower_tilt)->tilt_deg,
                    plan.angle_source, width, height, plan.pixel_size_A * plan.bin_factor));
    if (plan.axis)
      base::log_info(fmt::format("tilt axis of the views: {:.6g}° from {}", plan.axis->angle_deg,
                                 plan.axis->source));
    if (fixed_pattern.is_any())
      base::log_info("fixed pattern removed: " + describe_pattern(fixed_pattern));
  }

  /// Finds how the sections of the halves compare with those of all frames.
  void match_halves(const distributed::Communicator& processes) {
    const base::TraceSpan span("match halves");
    std::vector<HalfMoments> moments(views.size());
    for_own_views("match halves", processes, [&](std::size_t view) {
      moments[view] = halves->measure(views[view].section, decoder.read_masked(view));
    });
    processes.allreduce_sum(std::span(moments), &HalfMoments::n, &HalfMoments::all,
                            &HalfMoments::even, &HalfMoments::odd, &HalfMoments::all_squares,
                            &HalfMoments::sum_squares, &HalfMoments::products,
                            &HalfMoments::num_not_finite, &HalfMoments::even_squares,
                            &HalfMoments::odd_squares);
    processes.run_collectively([&] {
      std::vector<std::int64_t> sections;
      for (const View& view : views) sections.push_back(view.section);
      halves->match(sections, moments, *stack);
    });
  }

  // -------------------------------------------------------------- measuring

  void measure_logarithms(const distributed::Communicator& processes) {
    if (!(intensity.empty_beam + intensity.log_base > 0.0)) {
      throw distributed::SharedError(
          fmt::format("--log needs positive intensities, but the empty beam of '{}' is "
                      "found at {}; the data may be normalised or line integrals already: "
                      "leave --log out (--ignore LOG, if a tilt.com has it), or add to them with "
                      "--log-base",
                      stack->name(), intensity.empty_beam));
    }
    const base::TraceSpan span("take logarithms");
    std::atomic<std::int64_t> num_raised_here = 0;
    for_own_views("take logarithms", processes, [&](std::size_t view) {
      MaskedImage image = measured->read(view);
      num_raised_here += intensity.convert(&image);
      noise_sigma[view] = estimate_noise_sigma(image);
    });
    std::int64_t num_raised = num_raised_here;
    processes.allreduce_sum(std::span(noise_sigma));
    processes.allreduce_sum(std::span(&num_raised, 1));
    if (num_raised == 0) return;
    base::log_warning(fmt::format(
        "{} pixels of '{}' ({:.3g} %) are zero, negative or below a thousandth of the empty beam "
        "({}); they are raised to it before the logarithm",
        num_raised, stack->name(),
        100.0 * static_cast<double>(num_raised) /
            static_cast<double>(width * height * static_cast<std::int64_t>(views.size())),
        intensity.empty_beam));
  }

  /// Returns views for a search for beads.
  BeadViews bead_views(const distributed::Communicator& processes,
                       std::function<MaskedImage(std::size_t)> read) const {
    BeadViews result;
    for (const View& view : views) result.tilt_deg.push_back(view.tilt_deg);
    result.read = std::move(read);
    result.at_once = views_at_once(decoder.memory(), processes);
    return result;
  }

  /// Finds beads and fiducials in aligned images.
  void find_beads(const distributed::Communicator& processes) {
    const base::TraceSpan span("find beads");
    const ViewStore* store = options.resample ? measured.get() : aligned.get();
    const auto read = [&](std::size_t view) {
      MaskedImage image = store->read(view);
      intensity.convert(&image);
      return image;
    };
    beads = find_bead_masks(options, plan, *stack, bead_views(processes, read), processes);
    beads.metrics.num_bad_pixels = num_bad_pixels;
    beads.metrics.fixed_pattern = fixed_pattern;
    aligned.reset();
    if (options.resample) return;
    for (auto* discs : {&beads.discs, &beads.undecided}) {
      for (std::size_t view = 0; view < views.size(); ++view)
        for (MaskDisc& disc : (*discs)[view]) disc = as_recorded(disc, view);
    }
  }

  /// Measures the noise of stored views with beads once more, without the pixels of these.
  void measure_noise_beside_beads(const distributed::Communicator& processes) {
    const auto has_beads = [&](std::size_t view) {
      return !beads.discs[view].empty() || !beads.undecided[view].empty();
    };
    std::vector<double> beside(views.size(), 0.0);
    for_own_views("measure noise", processes, [&](std::size_t view) {
      if (!measured || !has_beads(view)) return;
      MaskedImage image = measured->read(view);
      mask_discs(beads.discs[view], &image);
      mask_discs(beads.undecided[view], &image);
      if (options.take_log) intensity.convert(&image);
      if (std::ranges::count(image.valid, kMeasurement) > 0)
        beside[view] = estimate_noise_sigma(image);
    });
    processes.allreduce_sum(std::span(beside));
    for (std::size_t view = 0; view < views.size(); ++view)
      if (beside[view] > 0.0) noise_sigma[view] = beside[view];
  }

  /// Moves a disc of an aligned, binned view into the view as it was recorded.
  MaskDisc as_recorded(const MaskDisc& disc, std::size_t view) const {
    const RawFromAligned m = plan.views[view].raw_from_aligned.binned(plan.bin_factor);
    const double x = disc.x_px - static_cast<double>(decoder.aligned_width()) / 2;
    const double y = disc.y_px - static_cast<double>(decoder.aligned_height()) / 2;
    return {m.m11 * x + m.m12 * y + m.shift_x_px + static_cast<double>(width) / 2,
            m.m21 * x + m.m22 * y + m.shift_y_px + static_cast<double>(height) / 2,
            disc.radius_px * std::sqrt(std::abs(m.m11 * m.m22 - m.m12 * m.m21))};
  }

  /// Returns a view as line integrals, without what masked beads and fiducials hide and, if its
  /// transfer is given, without their fringes.
  MaskedImage line_integrals(std::size_t view, const microscope::ViewTransfer* transfer) const {
    return line_integrals(stored_or_decoded(view), view, transfer);
  }

  /// Returns a view as line integrals in which no beads are masked.
  MaskedImage line_integrals_with_beads(std::size_t view) const {
    MaskedImage image = stored_or_decoded(view);
    intensity.convert(&image);
    return image;
  }

  /// Returns a view in the frame that the options ask for, as stored intensities.
  MaskedImage stored_or_decoded(std::size_t view) const {
    if (measured && measured->holds(view)) return measured->read(view);
    return in_wanted_frame(decoder.decode(view, wanted_frame()));
  }

  MaskedImage line_integrals_of_half(Half half, std::size_t view,
                                     const microscope::ViewTransfer* transfer) const {
    return line_integrals(in_wanted_frame(decoder.decode_half(half, *halves, view, wanted_frame())),
                          view, transfer);
  }

  Frames wanted_frame() const {
    return {.recorded = !options.resample, .aligned = options.resample};
  }

  MaskedImage in_wanted_frame(DecodedView decoded) const {
    return std::move(options.resample ? decoded.aligned : decoded.recorded);
  }

  MaskedImage line_integrals(MaskedImage image, std::size_t view,
                             const microscope::ViewTransfer* transfer) const {
    intensity.convert(&image);
    std::vector<MaskDisc> hidden = beads.discs[view];
    if (transfer && has_phase_contrast(transfer->optics)) {
      const double pixel_A = plan.pixel_size_A * plan.bin_factor;
      hidden = subtract_beads(hidden, beads.metrics.bead_diameter_A / pixel_A, *transfer, &image);
    }
    mask_discs(hidden, &image);
    mark_undecided(beads.undecided[view], &image);
    return image;
  }
};

std::string describe_beads(const MaskMetrics& masks) {
  if (masks.num_beads == 0) return "no beads";
  return fmt::format("{} beads of {:.3g} nm", masks.num_beads, masks.bead_diameter_A / 10);
}

TiltSeries::TiltSeries(const TiltSeriesOptions& options,
                       const distributed::Communicator& processes) {
  processes.run_collectively([&] { impl_ = std::make_unique<Impl>(options); });
  if (options.look_at_views) impl_->look_over(processes);
}
TiltSeries::~TiltSeries() = default;
TiltSeries::TiltSeries(TiltSeries&&) noexcept = default;

const std::vector<View>& TiltSeries::views() const { return impl_->views; }
std::int64_t TiltSeries::width() const { return impl_->width; }
std::int64_t TiltSeries::height() const { return impl_->height; }
std::int64_t TiltSeries::aligned_width() const { return impl_->decoder.aligned_width(); }
std::int64_t TiltSeries::aligned_height() const { return impl_->decoder.aligned_height(); }
bool TiltSeries::is_resampled() const { return impl_->options.resample; }
geometry::RawFromAligned TiltSeries::raw_from_aligned(std::size_t view) const {
  return impl_->plan.views[view].raw_from_aligned.binned(bin_factor());
}
double TiltSeries::pixel_size_A() const { return impl_->plan.pixel_size_A * bin_factor(); }
double TiltSeries::bin_factor() const { return impl_->plan.bin_factor; }
const std::vector<double>& TiltSeries::noise_sigma() const { return impl_->noise_sigma; }
double TiltSeries::empty_beam() const { return impl_->intensity.empty_beam; }

double TiltSeries::background() const { return impl_->background; }
const std::optional<StatedAxis>& TiltSeries::stated_axis() const { return impl_->plan.axis; }

const MaskMetrics& TiltSeries::mask_metrics() const { return impl_->beads.metrics; }
const std::vector<std::vector<MaskDisc>>& TiltSeries::undecided_beads() const {
  return impl_->beads.undecided;
}

std::vector<std::vector<BeadSpot>> TiltSeries::find_bead_spots(
    std::span<const geometry::ViewCorrection> corrections, double axis_x_px,
    const distributed::Communicator& processes) const {
  TOMOFIELD_CHECK(!is_resampled() && corrections.size() == views().size(),
                  "beads are looked for in views as recorded, each with a correction");
  if (!searches_beads(impl_->options)) return {};
  const auto read = [&](std::size_t view) {
    const RawFromAligned transform =
        geometry::corrected(raw_from_aligned(view), corrections[view].binned(bin_factor()));
    return align_image(impl_->line_integrals_with_beads(view), transform, aligned_width(),
                       aligned_height());
  };
  BeadViews bead_views = impl_->bead_views(processes, read);
  bead_views.axis_x_px = axis_x_px;
  for (std::size_t view = 0; view < corrections.size(); ++view)
    bead_views.tilt_deg[view] += corrections[view].tilt_deg;
  return search_beads(impl_->options, impl_->plan, bead_views, processes).spots;
}

void TiltSeries::read_view(std::size_t view, std::span<float> image, std::span<std::uint8_t> valid,
                           const microscope::ViewTransfer* transfer) const {
  TOMOFIELD_CHECK(view < impl_->views.size(), fmt::format("there is no view {}", view));
  TOMOFIELD_CHECK(
      image.size() == static_cast<std::size_t>(width() * height()) && valid.size() == image.size(),
      "image and mask must have width × height elements");
  const MaskedImage integrals = impl_->line_integrals(view, transfer);
  std::ranges::copy(integrals.values, image.begin());
  std::ranges::copy(integrals.valid, valid.begin());
}

void TiltSeries::read_half(Half half, std::size_t view, std::span<float> image,
                           std::span<std::uint8_t> valid,
                           const microscope::ViewTransfer* transfer) const {
  TOMOFIELD_CHECK(impl_->halves.has_value(), "the options name no halves");
  const MaskedImage integrals = impl_->line_integrals_of_half(half, view, transfer);
  std::ranges::copy(integrals.values, image.begin());
  std::ranges::copy(integrals.valid, valid.begin());
}

void TiltSeries::forget_view(std::size_t view) const {
  if (impl_->measured && impl_->measured->holds(view)) impl_->measured->discard(view);
}

std::size_t TiltSeries::decoding_memory() const { return impl_->decoder.memory(); }

std::size_t TiltSeries::stored_memory(const distributed::Communicator& processes) const {
  const std::size_t capacity = max_own_views(views().size(), processes);
  const std::size_t aligned =
      ViewStore::resident_memory(capacity, aligned_width(), aligned_height());
  return ViewStore::resident_memory(capacity, width(), height()) +
         (impl_->stores_aligned() ? aligned : 0);
}

}  // namespace tomofield::tilt_series
