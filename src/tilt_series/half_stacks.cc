#include "tilt_series/half_stacks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "base/check.h"
#include "base/log.h"
#include "base/statistics.h"
#include "io/images/mrc_format.h"
#include "io/tables/alignment_files.h"
#include "tomofield/error.h"

namespace tomofield::tilt_series {
namespace {

// Noise of the camera may differ a little from sum to sum; sections of another series do not
// correlate at all.
constexpr double kLeastCorrelation = 0.5, kGoodCorrelation = 0.9;

// Counts lie well above zero.
constexpr double kLeastMean = 0.5;  // in standard deviations
constexpr double kLargestMismatch = 0.05;

struct Slope {
  double slope = 0.0, correlation = 0.0;
};

Slope slope_of(const HalfMoments& moments) {
  if (!(moments.all_squares > 0 && moments.sum_squares > 0)) return {};
  return {moments.products / moments.sum_squares,
          moments.products / std::sqrt(moments.all_squares * moments.sum_squares)};
}

// Returns the slope of all frames over the sum of the halves, over all sections.
Slope slope_of_all(std::span<const HalfMoments> moments) {
  HalfMoments total;
  for (const HalfMoments& m : moments) {
    total.all_squares += m.all_squares;
    total.sum_squares += m.sum_squares;
    total.products += m.products;
  }
  return slope_of(total);
}

bool are_counts(std::span<const HalfMoments> moments, double slope) {
  return std::ranges::all_of(moments, [&](const HalfMoments& m) {
    const double sum = m.even + m.odd;
    const double deviation = std::sqrt(m.sum_squares / m.n);
    return m.even > 0 && m.odd > 0 && m.all > 0 && sum > kLeastMean * deviation &&
           std::abs(slope * sum - m.all) < kLargestMismatch * m.all;
  });
}

void require_finite(const HalfMoments& moments, std::int64_t section, const std::string& halves,
                    const std::string& all) {
  if (moments.num_not_finite == 0) return;
  throw Error(
      fmt::format("section {} of {} has {} pixels that are NaN or infinite in one of them and "
                  "measured in '{}': "
                  "write the halves with the same masks as the stack of all frames",
                  section + 1, halves, moments.num_not_finite, all));
}

// Refuses a half whose sections are constant, as black ones are, and names all of them.
void require_varying(std::span<const std::int64_t> sections, std::span<const HalfMoments> moments,
                     double HalfMoments::*squares, const std::string& half) {
  std::vector<std::int64_t> constant;
  for (std::size_t i = 0; i < sections.size(); ++i)
    if (moments[i].n > 0 && moments[i].*squares == 0) constant.push_back(sections[i] + 1);
  if (constant.empty()) return;
  throw Error(fmt::format(
      "section{} {} of '{}' {} constant: every pixel has the same value; write the half again, or "
      "leave {} out with --exclude",
      constant.size() == 1 ? "" : "s", io::section_list(constant), half,
      constant.size() == 1 ? "is" : "are", constant.size() == 1 ? "it" : "them"));
}

// Refuses two stacks of equal pixels: halves have noise of their own.
void require_apart(std::span<const HalfMoments> moments, double HalfMoments::*num_apart,
                   const std::string& half, const std::string& other) {
  if (std::ranges::any_of(moments, [&](const HalfMoments& m) { return m.*num_apart > 0; })) return;
  throw Error(
      fmt::format("all pixels of '{}' and '{}' are equal, so they have the same noise: give the "
                  "even and the odd frames of the series",
                  half, other));
}

// Refuses a sum of halves that does not look like all frames, and warns of one that roughly does.
void require_alike(double correlation, const std::string& halves, const std::string& all) {
  if (!(correlation >= kLeastCorrelation)) {
    throw Error(fmt::format(
        "{} are no halves of '{}': their sum correlates with it by {:.2f} only; give the even and "
        "the odd frames of the same series, aligned in the same way",
        halves, all, correlation));
  }
  if (correlation < kGoodCorrelation)
    base::log_warning(
        fmt::format("the sum of {} correlates with '{}' by {:.2f} only: is it made "
                    "from other frames, or weighted or filtered otherwise?",
                    halves, all, correlation));
}

// Warns of sections whose halves look less like all frames than those of the others do: one of them
// may be of another view.
void warn_of_others(std::span<const std::int64_t> sections, std::span<const HalfMoments> moments,
                    const std::string& halves, const std::string& all) {
  constexpr double kUsual = 0.05, kTimes = 3;
  std::vector<double> correlations;
  for (const HalfMoments& m : moments) correlations.push_back(slope_of(m).correlation);
  const double usual = base::median(correlations);
  const double least = usual - kUsual - kTimes * (1 - usual);
  std::vector<std::int64_t> others;
  for (std::size_t i = 0; i < sections.size(); ++i)
    if (moments[i].n > 0 && correlations[i] < least) others.push_back(sections[i] + 1);
  if (others.empty()) return;
  base::log_warning(fmt::format(
      "in section{} {} the sum of {} correlates with '{}' by {:.2f} only, and by {:.2f} in the "
      "others: are these the halves of the same views? (--exclude leaves sections out)",
      others.size() == 1 ? "" : "s", io::section_list(others), halves, all,
      std::ranges::min(correlations), usual));
}

// Warns of halves that differ in their scale, where one gain counts for both.
void warn_of_other_scale(std::span<const HalfMoments> moments, const std::string& even,
                         const std::string& odd) {
  constexpr double kLargestRatio = 1.3;
  double even_squares = 0, odd_squares = 0;
  for (const HalfMoments& m : moments) even_squares += m.even_squares, odd_squares += m.odd_squares;
  const double ratio = std::sqrt(even_squares / odd_squares);
  if (ratio < kLargestRatio && ratio > 1 / kLargestRatio) return;
  base::log_warning(fmt::format(
      "the pixels of '{}' vary {:.3g} times as much as those of '{}', and both count in one scale: "
      "give two sums, or two means, of equally many frames",
      even, ratio, odd));
}

void require_same_size(const io::ImageStack& half, const io::ImageStack& all) {
  const io::MrcHeader &a = half.header(), &b = all.header();
  if (a.nx == b.nx && a.ny == b.ny && a.nz == b.nz) return;
  throw Error(fmt::format(
      "'{}' has {} sections of {} × {} pixels and '{}' {} of {} × {}: give halves with the same "
      "sections as the stack of all frames",
      half.name(), a.nz, a.nx, a.ny, all.name(), b.nz, b.nx, b.ny));
}

// Warns of a correction that a half has had, as its header says, and the stack of all frames has
// not.
void warn_of_corrections(const io::ImageStack& half, const io::ImageStack& all) {
  const auto warn = [&](bool of_half, bool of_all, const char* what) {
    if (of_half != of_all)
      base::log_warning(fmt::format(
          "by their headers, '{}' {} {} and '{}' {}: both count as the "
          "latter, so treat them alike",
          half.name(), of_half ? "was" : "was not", what, all.name(), of_all ? "was" : "was not"));
  };
  warn(io::is_phase_flipped(half.header()), io::is_phase_flipped(all.header()),
       "phase-flipped (ctfphaseflip)");
  warn(io::is_dose_weighted(half.header()), io::is_dose_weighted(all.header()),
       "weighted by the dose");
}

}  // namespace

HalfStacks::HalfStacks(const HalfPaths& paths, const io::ImageStack& all)
    : stacks_{io::open_image_stack(paths.even), io::open_image_stack(paths.odd)} {
  for (const auto& half : stacks_) io::warn_of_mode(half->header(), half->name());
  for (const auto& half : stacks_) require_same_size(*half, all);
  for (const auto& half : stacks_) warn_of_corrections(*half, all);
}

HalfMoments HalfStacks::measure(std::int64_t section, const MaskedImage& all) const {
  std::vector<float> even(all.values.size()), odd(all.values.size());
  stack(Half::kEven).read_section(section, even);
  stack(Half::kOdd).read_section(section, odd);
  HalfMoments m;
  const auto for_pixels = [&](const auto& body) {
    for (std::size_t i = 0; i < even.size(); ++i)
      if (all.valid[i] != kNoMeasurement && std::isfinite(even[i]) && std::isfinite(odd[i]))
        body(static_cast<double>(all.values[i]), static_cast<double>(even[i]),
             static_cast<double>(odd[i]));
  };
  for_pixels([&](double a, double e, double o) {
    m.n += 1;
    m.all += a;
    m.even += e;
    m.odd += o;
    m.num_between += e != o ? 1 : 0;
    m.num_even_apart += e != a ? 1 : 0;
    m.num_odd_apart += o != a ? 1 : 0;
  });
  const auto num_measured =
      std::ranges::count_if(all.valid, [](std::uint8_t state) { return state != kNoMeasurement; });
  m.num_not_finite = static_cast<double>(num_measured) - m.n;
  if (m.n > 0) m.all /= m.n, m.even /= m.n, m.odd /= m.n;
  for_pixels([&](double a, double e, double o) {
    const double sum = e + o - m.even - m.odd;
    m.all_squares += (a - m.all) * (a - m.all);
    m.sum_squares += sum * sum;
    m.products += (a - m.all) * sum;
    m.even_squares += (e - m.even) * (e - m.even);
    m.odd_squares += (o - m.odd) * (o - m.odd);
  });
  return m;
}

void HalfStacks::match(std::span<const std::int64_t> sections, std::span<const HalfMoments> moments,
                       const io::ImageStack& all) {
  const std::string names =
      fmt::format("'{}' and '{}'", stack(Half::kEven).name(), stack(Half::kOdd).name());
  for (std::size_t i = 0; i < sections.size(); ++i)
    require_finite(moments[i], sections[i], names, all.name());
  require_varying(sections, moments, &HalfMoments::even_squares, stack(Half::kEven).name());
  require_varying(sections, moments, &HalfMoments::odd_squares, stack(Half::kOdd).name());
  require_apart(moments, &HalfMoments::num_between, stack(Half::kEven).name(),
                stack(Half::kOdd).name());
  require_apart(moments, &HalfMoments::num_even_apart, stack(Half::kEven).name(), all.name());
  require_apart(moments, &HalfMoments::num_odd_apart, stack(Half::kOdd).name(), all.name());
  const Slope found = slope_of_all(moments);
  require_alike(found.correlation, names, all.name());
  warn_of_others(sections, moments, names, all.name());
  const bool is_ratio = are_counts(moments, found.slope);
  if (!is_ratio) warn_of_other_scale(moments, stack(Half::kEven).name(), stack(Half::kOdd).name());
  const double gain = 2 * found.slope;
  for (std::size_t i = 0; i < sections.size(); ++i) {
    const HalfMoments& m = moments[i];
    const auto match_to = [&](double mean) {
      return is_ratio ? Match{m.all / mean, 0.0} : Match{gain, m.all - gain * mean};
    };
    matches_[sections[i]] = {match_to(m.even), match_to(m.odd)};
  }
}

void HalfStacks::read_section(Half half, std::int64_t section, std::span<float> out) const {
  const auto found = matches_.find(section);
  TOMOFIELD_CHECK(found != matches_.end(), "the section has been matched");
  stack(half).read_section(section, out);
  const auto& [gain, offset] = found->second[static_cast<std::size_t>(half)];
  for (float& value : out) value = static_cast<float>(gain * static_cast<double>(value) + offset);
}

}  // namespace tomofield::tilt_series
