#include "tilt_series/fixed_pattern/line_profiles.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "base/statistics.h"

namespace tomofield::tilt_series {
namespace {

constexpr std::int64_t kMedianReach = 7;
constexpr std::int64_t kFewestAround = 4;  // on each side
constexpr float kMissing = std::numeric_limits<float>::quiet_NaN();

/// Returns the profile less its running median. Lines count in pairs, one on each side, so that a
/// slope has no effect where others are missing.
std::vector<float> without_median(const std::vector<float>& profile) {
  const std::int64_t size = std::ssize(profile);
  std::vector<float> result(profile.size(), kMissing), around;
  const auto value_at = [&](std::int64_t line) { return profile[static_cast<std::size_t>(line)]; };
  for (std::int64_t line = 0; line < size; ++line) {
    around.assign(1, value_at(line));
    for (std::int64_t away = 1; away <= std::min({kMedianReach, line, size - 1 - line}); ++away) {
      const float before = value_at(line - away), after = value_at(line + away);
      if (std::isnan(before) || std::isnan(after)) continue;
      around.push_back(before);
      around.push_back(after);
    }
    if (std::ssize(around) <= 2 * kFewestAround || std::isnan(around.front())) continue;
    result[static_cast<std::size_t>(line)] = value_at(line) - base::median_in_place(around);
  }
  return result;
}

}  // namespace

LineProfiles line_profiles(const MaskedImage& image, Lines lines) {
  const bool are_columns = lines == Lines::kColumns;
  const auto num_lines = static_cast<std::size_t>(are_columns ? image.width : image.height);
  const std::int64_t length = are_columns ? image.height : image.width;
  std::vector<KnownMean> means(kLineParts * num_lines);
  for (std::int64_t y = 0; y < image.height; ++y) {
    for (std::int64_t x = 0; x < image.width; ++x) {
      const std::size_t at = image.index(x, y);
      if (!image.valid[at]) continue;
      const std::int64_t part = (are_columns ? y : x) * std::int64_t{kLineParts} / length;
      const auto line = static_cast<std::size_t>(are_columns ? x : y);
      KnownMean& mean = means[static_cast<std::size_t>(part) * num_lines + line];
      mean.sum += image.values[at];
      mean.count += 1.0;
    }
  }
  LineProfiles profiles;
  const double enough = 0.5 * static_cast<double>(length) / static_cast<double>(kLineParts);
  for (auto first = means.begin(); first != means.end();
       first += static_cast<std::ptrdiff_t>(num_lines)) {
    std::vector<float> profile;
    for (auto mean = first; mean != first + static_cast<std::ptrdiff_t>(num_lines); ++mean)
      profile.push_back(static_cast<float>(mean->get(enough)));
    profiles.push_back(without_median(profile));
  }
  return profiles;
}

}  // namespace tomofield::tilt_series
