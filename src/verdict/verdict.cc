#include "verdict/verdict.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstddef>
#include <numeric>

#include "base/log.h"
#include "base/statistics.h"
#include "evaluate/artefacts.h"

namespace tomofield::verdict {
namespace {

std::string prior_text(const PriorSummary& prior) {
  if (!prior.gain) return "learned prior";
  return fmt::format(
      "{}learned prior, which changes the held-out error by {:+.2f} % ± {:.2f} in trials",
      prior.is_used ? "" : "no ", -100 * prior.gain->log_ratio, 100 * prior.gain->standard_error);
}

std::string held_out_text(const HeldOutSummary& held_out) {
  return fmt::format("held out{}: median {:.2f}, worst {:.2f} (at {:.1f}°)",
                     held_out.is_of_trials ? " in trials" : "", held_out.median, held_out.worst,
                     held_out.worst_tilt_deg);
}

}  // namespace

SectionProfile section_profile(const std::vector<double>& deviation) {
  if (deviation.empty()) return {};
  const std::vector<float> values(deviation.begin(), deviation.end());
  const std::ptrdiff_t count = std::ssize(values), outer = std::max<std::ptrdiff_t>(count / 20, 1);
  const double top = std::accumulate(deviation.begin(), deviation.begin() + outer, 0.0);
  const double bottom = std::accumulate(deviation.end() - outer, deviation.end(), 0.0);
  const double middle = base::median({values.begin() + count / 4, values.end() - count / 4});
  const double limit = 0.3 * base::percentile(values, 80);
  const auto empty = std::ranges::count_if(deviation, [&](double d) { return d < limit; });
  SectionProfile profile;
  if (middle > 0.0) profile.faces = std::min(top, bottom) / static_cast<double>(outer) / middle;
  profile.empty_part = static_cast<double>(empty) / static_cast<double>(count);
  return profile;
}

std::string verdict_line(const Verdict& verdict) {
  std::vector<std::string> parts{
      fmt::format("residual {:.2f} of the noise's variance", verdict.residual)};
  if (verdict.views) {
    const auto [x, y] = verdict.views->residual_correlation;
    parts.push_back(fmt::format("correlation of neighbours {:.2f}, {:.2f}", x, y));
  }
  if (verdict.held_out) parts.push_back(held_out_text(*verdict.held_out));
  if (verdict.prior.is_used || verdict.prior.gain) parts.push_back(prior_text(verdict.prior));
  if (verdict.artefacts.speckle)
    parts.push_back(fmt::format("speckle {:.3f} %", 100 * *verdict.artefacts.speckle));
  if (verdict.artefacts.faces)
    parts.push_back(fmt::format("faces {:.2f}", verdict.artefacts.faces->both));
  parts.push_back(fmt::format("{:.1f} s, {:.2f} GiB", verdict.seconds, verdict.peak_GiB));
  return fmt::format("verdict: {}", fmt::join(parts, "; "));
}

void log_verdict(const Verdict& verdict) {
  base::log_info(verdict_line(verdict));
  for (const Warning& warning : verdict.warnings) base::log_warning(warning.message);
}

}  // namespace tomofield::verdict
