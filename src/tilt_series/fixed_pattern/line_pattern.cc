#include "tilt_series/fixed_pattern/line_pattern.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <utility>

#include "base/statistics.h"
#include "tilt_series/fixed_pattern/line_profiles.h"

namespace tomofield::tilt_series {
namespace {

constexpr std::size_t kFewestLines = 64;
constexpr std::size_t kFirstMove = 8;   // lines: beyond the width of what the median lets pass
constexpr std::size_t kLastMove = 128;  // enough to know what chance does
constexpr double kClearOfMoves = 1.5;
constexpr double kClearOfChance = 8.0;  // standard errors

/// The profile of a view over the whole length of its lines: medians over the parts, 0 if missing.
std::vector<double> whole_profile(const LineProfiles& parts) {
  std::vector<double> profile;
  for (std::size_t line = 0; line < parts.front().size(); ++line) {
    std::vector<float> values;
    for (const std::vector<float>& part : parts)
      if (!std::isnan(part[line])) values.push_back(part[line]);
    profile.push_back(2 * values.size() >= parts.size() ? base::percentile(std::move(values), 50.0)
                                                        : 0.0);
  }
  return profile;
}

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

/// Returns the first left singular vector of the views' profiles, [view].
std::vector<double> common_strengths(const std::vector<LineProfiles>& views, base::Range unmoved) {
  std::vector<std::vector<double>> profiles;
  for (const LineProfiles& view : views) {
    profiles.push_back(whole_profile(view));
    for (int line = unmoved.begin; line < unmoved.end; ++line)
      profiles.back()[static_cast<std::size_t>(line)] = 0.0;
  }
  constexpr int kIterations = 50;
  std::vector<double> strengths(views.size(), 1.0);
  for (int i = 0; i < kIterations; ++i) {
    std::vector<double> pattern(profiles.front().size());
    for (std::size_t view = 0; view < views.size(); ++view)
      for (std::size_t line = 0; line < pattern.size(); ++line)
        pattern[line] += strengths[view] * profiles[view][line];
    const double length = std::sqrt(dot(pattern, pattern));
    if (!(length > 0.0)) return strengths;
    for (std::size_t view = 0; view < views.size(); ++view)
      strengths[view] = dot(profiles[view], pattern) / length;
  }
  return strengths;
}

/// Profiles of a group of views, weighted by the strength of a pattern: [part][line], NaN where
/// fewer than half of the views have them.
using GroupProfiles = std::vector<std::vector<double>>;

std::vector<GroupProfiles> profiles_of_groups(const std::vector<LineProfiles>& views,
                                              std::span<const int> group_of_view,
                                              const std::vector<double>& strengths) {
  const int num_groups = 1 + *std::max_element(group_of_view.begin(), group_of_view.end());
  const std::size_t num_lines = views.front().front().size();
  std::vector<GroupProfiles> groups(static_cast<std::size_t>(num_groups),
                                    GroupProfiles(kLineParts, std::vector<double>(num_lines)));
  for (std::size_t group = 0; group < groups.size(); ++group) {
    std::vector<std::size_t> members;
    double squares = 0.0;
    for (std::size_t view = 0; view < views.size(); ++view) {
      if (group_of_view[view] != static_cast<int>(group)) continue;
      members.push_back(view);
      squares += strengths[view] * strengths[view];
    }
    for (std::size_t part = 0; part < kLineParts; ++part) {
      for (std::size_t line = 0; line < num_lines; ++line) {
        double sum = 0.0, weight = 0.0;
        for (const std::size_t view : members) {
          const double value = views[view][part][line];
          if (std::isnan(value)) continue;
          sum += strengths[view] * value;
          weight += strengths[view] * strengths[view];
        }
        groups[group][part][line] =
            weight > 0.5 * squares ? sum / weight : std::numeric_limits<double>::quiet_NaN();
      }
    }
  }
  return groups;
}

/// Returns the second differences of a profile; 0 where they are missing or do not count.
std::vector<double> fine_detail(const std::vector<double>& profile, base::Range unmoved) {
  std::vector<double> detail(profile.size());
  for (std::size_t line = 1; line + 1 < profile.size(); ++line) {
    const double value = profile[line - 1] - 2.0 * profile[line] + profile[line + 1];
    if (!std::isnan(value) && !unmoved.contains(static_cast<int>(line))) detail[line] = value;
  }
  return detail;
}

/// Returns the mean product of two profiles, of which the second is moved by some lines.
double mean_product(const std::vector<double>& a, const std::vector<double>& b, std::size_t move) {
  double sum = 0.0;
  for (std::size_t line = 0; line + move < a.size(); ++line) sum += a[line] * b[line + move];
  return sum / static_cast<double>(a.size() - move);
}

/// Measures how well the fine detail of different groups and parts agrees if one of them is moved.
class Agreement {
 public:
  Agreement(std::vector<GroupProfiles> groups, base::Range unmoved)
      : groups_(std::move(groups)), sums_(groups_.size()) {
    for (std::size_t group = 0; group < groups_.size(); ++group) {
      sums_[group].resize(groups_.front().front().size());
      for (std::vector<double>& profile : groups_[group]) {
        profile = fine_detail(profile, unmoved);
        for (std::size_t line = 0; line < profile.size(); ++line)
          sums_[group][line] += profile[line];
      }
    }
  }

  /// Returns the agreement of one part with the other parts of other groups.
  double of_part(std::size_t part, std::size_t move) const {
    double sum = 0.0;
    for (std::size_t one = 0; one < groups_.size(); ++one) {
      for (std::size_t other = 0; other < groups_.size(); ++other) {
        if (one == other) continue;
        const std::vector<double>& profile = groups_[one][part];
        sum += mean_product(profile, sums_[other], move) -
               mean_product(profile, groups_[other][part], move);
      }
    }
    return sum;
  }

  /// Returns the mean agreement of all parts, and its standard error.
  std::pair<double, double> of_all(std::size_t move) const {
    KnownMean mean, squares;
    for (std::size_t part = 0; part < kLineParts; ++part) {
      const double value = of_part(part, move);
      mean.add(value);
      squares.add(value * value);
    }
    const double value = mean.get(1.0);
    const double variance = std::max(0.0, squares.get(1.0) - value * value) / (mean.count - 1.0);
    return {value, std::sqrt(variance)};
  }

  std::size_t num_lines() const { return sums_.front().size(); }

 private:
  std::vector<GroupProfiles> groups_;
  std::vector<std::vector<double>> sums_;  // over the parts
};

bool has_pattern(const Agreement& agreement) {
  const auto [in_place, error] = agreement.of_all(0);
  if (!(in_place > kClearOfChance * error)) return false;
  for (std::size_t move = kFirstMove; move <= std::min(kLastMove, agreement.num_lines() / 2);
       ++move)
    if (in_place < kClearOfMoves * std::fabs(agreement.of_all(move).first)) return false;
  return true;
}

/// Returns the value less what chance has on average, where its variance is known.
double shrunk(double value, double variance) {
  return value * value > variance ? value * (1.0 - variance / (value * value)) : 0.0;
}

/// Returns the mean over groups and parts of a line, shrunk by the variance between parts.
double pattern_of_line(const std::vector<GroupProfiles>& groups, std::size_t line) {
  KnownMean mean, squares;
  for (std::size_t part = 0; part < kLineParts; ++part) {
    KnownMean of_part;
    for (const GroupProfiles& group : groups) of_part.add(group[part][line]);
    const double value = of_part.get(static_cast<double>(groups.size()));
    mean.add(value);
    squares.add(value * value);
  }
  if (mean.count < 0.5 * kLineParts) return 0.0;
  const double value = mean.sum / mean.count;
  return shrunk(value, (squares.sum / mean.count - value * value) / (mean.count - 1.0));
}

/// Returns how strongly a view has a pattern, shrunk by the variance of what else it has.
double strength_of_view(const LineProfiles& view, const std::vector<double>& pattern) {
  std::vector<double> profile = whole_profile(view);
  const double length = dot(pattern, pattern);
  if (!(length > 0.0)) return 0.0;
  const double strength = dot(profile, pattern) / length;
  for (std::size_t line = 0; line < profile.size(); ++line)
    profile[line] -= strength * pattern[line];
  const double variance = dot(profile, profile) / static_cast<double>(profile.size());
  return shrunk(strength, variance / length);
}

/// Subtracts `strength` times the pattern from a view, and adds it to what was found in it.
void move_pattern(const std::vector<double>& pattern, double strength, LineProfiles* view,
                  std::vector<float>* found) {
  for (std::size_t line = 0; line < pattern.size(); ++line) {
    const auto value = static_cast<float>(strength * pattern[line]);
    for (std::vector<float>& part : *view) part[line] -= value;
    (*found)[line] += value;
  }
}

}  // namespace

std::vector<std::vector<float>> find_line_patterns(std::vector<LineProfiles> views,
                                                   std::span<const int> group_of_view,
                                                   base::Range unmoved) {
  constexpr int kMostPatterns = 4;
  const std::size_t num_lines = views.front().front().size();
  if (num_lines < kFewestLines) return {};
  std::vector<std::vector<float>> found;
  for (int i = 0; i < kMostPatterns; ++i) {
    const std::vector<GroupProfiles> groups =
        profiles_of_groups(views, group_of_view, common_strengths(views, unmoved));
    if (!has_pattern(Agreement(groups, unmoved))) break;
    found.resize(views.size(), std::vector<float>(num_lines));
    std::vector<double> pattern;
    for (std::size_t line = 0; line < num_lines; ++line)
      pattern.push_back(pattern_of_line(groups, line));
    for (std::size_t view = 0; view < views.size(); ++view)
      move_pattern(pattern, strength_of_view(views[view], pattern), &views[view], &found[view]);
  }
  return found;
}

}  // namespace tomofield::tilt_series
