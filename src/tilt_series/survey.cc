#include "tilt_series/survey.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <span>
#include <string>
#include <utility>

#include "base/log.h"
#include "base/trace.h"
#include "io/saving/scratch_memory.h"
#include "tilt_series/fixed_pattern/pattern_search.h"
#include "tilt_series/masks/subtract_beads.h"
#include "tilt_series/noise.h"
#include "tilt_series/own_views.h"
#include "tilt_series/view_check.h"
#include "tomofield/error.h"

namespace tomofield::tilt_series {
namespace {

bool has_lower_tilt(const View& a, const View& b) { return a.tilt_deg < b.tilt_deg; }

// Says whether a part of the contrast is that of phases, whose transfer puts fringes around beads.
// Optics without it (microscope::without_phase_contrast()) are those of pure absorption.
bool has_phase_contrast(const microscope::Optics& optics) { return optics.amplitude_contrast < 1; }

// Moves a disc of an aligned, binned view into the view as it was recorded.
MaskDisc as_recorded(const MaskDisc& disc, const PlannedSeries& series, std::size_t view) {
  const RawFromAligned m = series.raw_from_aligned(view);
  const double x = disc.x_px - static_cast<double>(series.aligned_width()) / 2;
  const double y = disc.y_px - static_cast<double>(series.aligned_height()) / 2;
  return {m.m11 * x + m.m12 * y + m.shift_x_px + static_cast<double>(series.width()) / 2,
          m.m21 * x + m.m22 * y + m.shift_y_px + static_cast<double>(series.height()) / 2,
          disc.radius_px * std::sqrt(std::abs(m.m11 * m.m22 - m.m12 * m.m21))};
}

// Looks at every view of a series.
class Surveyor {
 public:
  Surveyor(const PlannedSeries& series, const distributed::Communicator& processes)
      : series_(series), options_(series.options()), processes_(processes), survey_(series) {}

  SurveyedViews look_over() {
    decode_views();
    if (survey_.halves) match_halves();
    if (options_.take_log) measure_logarithms();
    find_beads();
    measure_noise_beside_beads();
    log_series();
    return {std::move(survey_), std::move(views_)};
  }

 private:
  std::size_t num_views() const { return series_.views().size(); }

  // Calls body(view) on all threads for each view that this process owns.
  template <typename Body>
  void for_own_views(const char* what, const Body& body) const {
    std::vector<std::size_t> own;
    for (std::size_t view = 0; view < num_views(); ++view)
      if (is_own_view(view, processes_)) own.push_back(view);
    const std::size_t at_once = views_at_once(series_.decoding_memory(), processes_);
    processes_.run_collectively([&] { for_views(what, own, at_once, body); });
  }

  // Makes room for the views as they are fitted and, if these are not aligned, for aligned ones.
  void make_stores() {
    const std::size_t capacity = max_own_views(num_views(), processes_);
    const std::filesystem::path dir =
        options_.scratch_dir.empty() ? io::scratch_directory({}) : options_.scratch_dir;
    const auto make = [&](std::int64_t width, std::int64_t height) {
      return std::make_unique<ViewStore>(num_views(), capacity, width, height, dir);
    };
    views_.reset();
    aligned_.reset();
    processes_.run_collectively([&] {
      views_ = make(series_.width(), series_.height());
      if (!series_.is_resampled() && searches_beads(options_))
        aligned_ = make(series_.aligned_width(), series_.aligned_height());
    });
  }

  // Decodes every view, and once more without a fixed pattern if they have one.
  void decode_views() {
    const io::MrcHeader& header = series_.stack().header();
    const bool searches =
        options_.remove_fixed_pattern && num_views() >= PatternSearch::kFewestViews;
    std::optional<PatternSearch> search;
    if (searches) search.emplace(num_views(), header.nx, header.ny);
    check(decode_once(searches ? &*search : nullptr));
    if (!searches) return;
    FixedPattern pattern = search->find(series_.plan(), processes_);
    if (pattern.is_empty()) return;
    search.reset();
    fixed_pattern_ = measure_pattern(pattern);
    survey_.decoder.set_fixed_pattern(std::move(pattern));
    decode_once(nullptr);
  }

  // Decodes every view: stores it, finds I0 and the noise, and adds it to `search`, if there is
  // one. The noise of I0 − I is that of I; only logarithms need I0 first.
  std::vector<ViewCheck> decode_once(PatternSearch* search) {
    make_stores();
    std::vector<ViewCheck> checks(num_views());
    std::vector<std::vector<float>> block_means(num_views());
    survey_.noise_sigma.assign(num_views(), 0.0);
    const bool is_resampled = series_.is_resampled();
    const Frames frames{.recorded = !is_resampled, .aligned = is_resampled || aligned_ != nullptr};
    const base::TraceSpan span("decode views");
    for_own_views("decode views", [&](std::size_t view) {
      const DecodedView decoded = survey_.decoder.decode(view, frames, search);
      const MaskedImage& image = is_resampled ? decoded.aligned : decoded.recorded;
      views_->write(view, image);
      if (aligned_) aligned_->write(view, decoded.aligned);
      checks[view] = check_view(decoded.census, image);
      append_block_means(image, &block_means[view]);
      if (!options_.take_log && checks[view].has_contrast)
        survey_.noise_sigma[view] = estimate_noise_sigma(image);
    });
    processes_.allreduce_sum(std::span(survey_.noise_sigma));
    measure_background(block_means);
    return checks;
  }

  void measure_background(const std::vector<std::vector<float>>& block_means) {
    if (options_.contrast == Contrast::kDark)
      survey_.intensity.empty_beam = estimate_empty_beam(block_means, processes_);
    else
      survey_.background =
          estimate_background(block_means, processes_) - options_.black_level.value_or(0.0);
  }

  // Shares what each process found in its views, and refuses what cannot be used.
  void check(std::vector<ViewCheck> checks) {
    processes_.allreduce_sum(std::span(checks), &ViewCheck::num_not_finite, &ViewCheck::num_bad,
                             &ViewCheck::num_masked, &ViewCheck::is_constant,
                             &ViewCheck::has_contrast);
    const io::MrcHeader& header = series_.stack().header();
    processes_.run_collectively([&] {
      require_plausible_scale(checks, series_.stack().name(), header.nx * header.ny);
      warn_of_mask(checks, options_.mask, header.nx * header.ny);
      for (std::size_t index = 0; index < num_views(); ++index) {
        const View& view = series_.views()[index];
        const std::string name = fmt::format("section {} (tilt {}°) of '{}'", view.section + 1,
                                             view.tilt_deg, series_.stack().name());
        require_usable(checks[index], name, view.section + 1, header.nx * header.ny);
        num_bad_pixels_ += checks[index].num_bad;
      }
    });
  }

  // Finds how the sections of the halves compare with those of all frames.
  void match_halves() {
    const base::TraceSpan span("match halves");
    std::vector<HalfMoments> moments(num_views());
    for_own_views("match halves", [&](std::size_t view) {
      moments[view] =
          survey_.halves->measure(series_.views()[view].section, survey_.decoder.read_masked(view));
    });
    processes_.allreduce_sum(std::span(moments), &HalfMoments::n, &HalfMoments::all,
                             &HalfMoments::even, &HalfMoments::odd, &HalfMoments::all_squares,
                             &HalfMoments::sum_squares, &HalfMoments::products,
                             &HalfMoments::num_not_finite, &HalfMoments::even_squares,
                             &HalfMoments::odd_squares, &HalfMoments::num_between,
                             &HalfMoments::num_even_apart, &HalfMoments::num_odd_apart);
    processes_.run_collectively([&] {
      std::vector<std::int64_t> sections;
      for (const View& view : series_.views()) sections.push_back(view.section);
      survey_.halves->match(sections, moments, series_.stack());
    });
  }

  void measure_logarithms() {
    const IntensityScale& intensity = survey_.intensity;
    if (!(intensity.empty_beam + intensity.log_base > 0.0)) {
      throw distributed::SharedError(
          fmt::format("--log needs positive intensities, but the empty beam of '{}' is "
                      "found at {}; the data may be normalised or line integrals already: "
                      "leave --log out (--ignore LOG, if a tilt.com has it), or add to them with "
                      "--log-base",
                      series_.stack().name(), intensity.empty_beam));
    }
    const base::TraceSpan span("take logarithms");
    std::atomic<std::int64_t> num_raised_here = 0;
    for_own_views("take logarithms", [&](std::size_t view) {
      MaskedImage image = views_->read(view);
      num_raised_here += intensity.convert(&image);
      survey_.noise_sigma[view] = estimate_noise_sigma(image);
    });
    std::int64_t num_raised = num_raised_here;
    processes_.allreduce_sum(std::span(survey_.noise_sigma));
    processes_.allreduce_sum(std::span(&num_raised, 1));
    if (num_raised == 0) return;
    const double num_pixels =
        static_cast<double>(series_.width() * series_.height()) * static_cast<double>(num_views());
    base::log_warning(fmt::format(
        "{} pixels of '{}' ({:.3g} %) are zero, negative or below a thousandth of the empty beam "
        "({}); they are raised to it before the logarithm",
        num_raised, series_.stack().name(), 100.0 * static_cast<double>(num_raised) / num_pixels,
        intensity.empty_beam));
  }

  // Finds beads and fiducials in aligned images.
  void find_beads() {
    const base::TraceSpan span("find beads");
    const ViewStore* store = series_.is_resampled() ? views_.get() : aligned_.get();
    const auto read = [&](std::size_t view) {
      MaskedImage image = store->read(view);
      survey_.intensity.convert(&image);
      return image;
    };
    BeadMasks& beads = survey_.beads;
    beads = find_bead_masks(options_, series_.plan(), series_.stack(),
                            survey_.bead_views(processes_, read), processes_);
    beads.metrics.num_bad_pixels = num_bad_pixels_;
    beads.metrics.fixed_pattern = fixed_pattern_;
    aligned_.reset();
    if (series_.is_resampled()) return;
    for (auto* discs : {&beads.discs, &beads.undecided}) {
      for (std::size_t view = 0; view < num_views(); ++view)
        for (MaskDisc& disc : (*discs)[view]) disc = as_recorded(disc, series_, view);
    }
  }

  // Measures the noise of stored views with beads once more, without the pixels of these.
  void measure_noise_beside_beads() {
    const BeadMasks& beads = survey_.beads;
    const auto has_beads = [&](std::size_t view) {
      return !beads.discs[view].empty() || !beads.undecided[view].empty();
    };
    std::vector<double> beside(num_views(), 0.0);
    for_own_views("measure noise", [&](std::size_t view) {
      if (!has_beads(view)) return;
      MaskedImage image = views_->read(view);
      mask_discs(beads.discs[view], &image);
      mask_discs(beads.undecided[view], &image);
      if (options_.take_log) survey_.intensity.convert(&image);
      if (std::ranges::count(image.valid, kMeasurement) > 0)
        beside[view] = estimate_noise_sigma(image);
    });
    processes_.allreduce_sum(std::span(beside));
    for (std::size_t view = 0; view < num_views(); ++view)
      if (beside[view] > 0.0) survey_.noise_sigma[view] = beside[view];
  }

  void log_series() const {
    const auto [lowest, highest] = std::ranges::minmax_element(series_.views(), has_lower_tilt);
    base::log_info(
        fmt::format("'{}': {} of {} sections, tilts {:.1f}° to {:.1f}° from {}, views of {} × {} "
                    "pixels of {:.6g} Å",
                    series_.stack().name(), num_views(), series_.stack().header().nz,
                    lowest->tilt_deg, highest->tilt_deg, series_.plan().angle_source,
                    series_.width(), series_.height(), series_.pixel_size_A()));
    if (const auto& axis = series_.stated_axis())
      base::log_info(
          fmt::format("tilt axis of the views: {:.6g}° from {}", axis->angle_deg, axis->source));
    if (fixed_pattern_.is_any())
      base::log_info("fixed pattern removed: " + describe_pattern(fixed_pattern_));
  }

  const PlannedSeries& series_;
  const TiltSeriesOptions& options_;
  const distributed::Communicator& processes_;
  Survey survey_;
  std::unique_ptr<ViewStore> views_;
  std::unique_ptr<ViewStore> aligned_;  // for the search for beads, where views_ are not aligned
  std::int64_t num_bad_pixels_ = 0;
  FixedPatternMetrics fixed_pattern_;
};

}  // namespace

Survey::Survey(const PlannedSeries& of)
    : series(of),
      decoder(of),
      intensity{of.options().contrast, of.options().take_log, 0.0,
                of.options().black_level.value_or(0.0), of.options().log_base} {
  const TiltSeriesOptions& options = of.options();
  if (options.even && options.odd)
    halves.emplace(HalfPaths{*options.even, *options.odd}, of.stack());
}

BeadViews Survey::bead_views(const distributed::Communicator& processes,
                             std::function<MaskedImage(std::size_t)> read) const {
  BeadViews result;
  for (const View& view : series.views()) result.tilt_deg.push_back(view.tilt_deg);
  result.read = std::move(read);
  result.at_once = views_at_once(series.decoding_memory(), processes);
  return result;
}

MaskedImage Survey::decode(std::size_t view) const {
  return in_fitted_frame(series, [&](Frames frames) { return decoder.decode(view, frames); });
}

MaskedImage Survey::decode(Half half, std::size_t view) const {
  return in_fitted_frame(
      series, [&](Frames frames) { return decoder.decode_half(half, *halves, view, frames); });
}

MaskedImage Survey::line_integrals(MaskedImage image, std::size_t view,
                                   const microscope::ViewTransfer* transfer) const {
  intensity.convert(&image);
  std::vector<MaskDisc> hidden = beads.discs[view];
  if (transfer && has_phase_contrast(transfer->optics)) {
    const double diameter_px = beads.metrics.bead_diameter_A / series.pixel_size_A();
    hidden = subtract_beads(hidden, diameter_px, *transfer, &image);
  }
  mask_discs(hidden, &image);
  mark_undecided(beads.undecided[view], &image);
  return image;
}

SurveyedViews survey_views(const PlannedSeries& series,
                           const distributed::Communicator& processes) {
  base::send(series.messages());
  return Surveyor(series, processes).look_over();
}

}  // namespace tomofield::tilt_series
