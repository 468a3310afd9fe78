#include <algorithm>
#include <cmath>

#include "base/range.h"
#include "kernels/line_projection.h"

namespace tomofield::kernels {
namespace {

using base::Range;
constexpr std::size_t kMax = CrossingGroup::kMax;

// An upper bound on the rounding errors of positions and of samples' pixels, for up to 10⁵ pixels.
// It keeps the `whole` range, which is used without tests, within its memory.
constexpr double kRounding = 0.01;

int rounded_up(double at) {
  const double within = std::clamp(at, -1e9, 1e9);
  const int truncated = static_cast<int>(within);
  return truncated + (within > truncated ? 1 : 0);
}

double position(const LineCrossing& c, int pixel) {
  return c.offset + static_cast<double>(c.step) * pixel;
}

// Sets a group's pixels. `whole` are those in all windows whose positions lie within [low, high) of
// every line by more than rounding. `reached` are those that may lie within some line.
void set_pixels(std::span<const LineCrossing> lines, CrossingGroup& group) {
  constexpr double kFar = 1e30;
  double low_of_all = -kFar, low_of_any = kFar, high_of_all = kFar, high_of_any = -kFar;
  Range in_all{lines[0].first_pixel, lines[0].end_pixel}, in_any = in_all;
  for (const LineCrossing& c : lines) {
    const double low = static_cast<double>(c.low) - c.offset;
    const double high = static_cast<double>(c.high) - c.offset;
    low_of_all = std::max(low_of_all, low);
    low_of_any = std::min(low_of_any, low);
    high_of_all = std::min(high_of_all, high);
    high_of_any = std::max(high_of_any, high);
    in_all = in_all.common_with({c.first_pixel, c.end_pixel});
    in_any = in_any.joined_with({c.first_pixel, c.end_pixel});
  }
  const double inverse = 1.0 / lines[0].step;
  const auto pixels = [&](double low, double high) {
    if (low >= high) return Range{};  // no pixel is within all lines
    const double a = low * inverse, b = high * inverse;
    return Range{rounded_up(std::min(a, b)), rounded_up(std::max(a, b))};
  };
  group.whole = pixels(low_of_all + kRounding, high_of_all - kRounding).common_with(in_all);
  group.reached = pixels(low_of_any - kRounding, high_of_any + kRounding).common_with(in_any);
}

// Returns the samples between two pixels of the window whose whole hats lie within [low, high). For
// |step| >= 1 no other pixel reaches them. For any step, the pixels that see the line reach at most
// two samples further.
Range samples_within(const LineCrossing& c) {
  const auto [low, high] = std::minmax({position(c, c.first_pixel), position(c, c.end_pixel - 1)});
  const double first = std::max(c.low + 1.0, low + kRounding);
  const double last = std::min(c.high - 1.0, high - kRounding);
  return {rounded_up(first), 1 - rounded_up(-last)};
}

// Returns the number of pairs of pixels that reach a sample. Rounding can only lose a weight that
// is itself as small as the rounding.
int pairs_a_sample(const LineCrossing& c) {
  return static_cast<int>(std::ceil((1.0f - 1e-6f) / std::abs(c.step)));
}

void put(const LineCrossing& c, std::size_t k, std::ptrdiff_t origin, CrossingGroup& group) {
  group.offset[k] = c.offset;
  group.step[k] = c.step;
  group.low[k] = c.low;
  group.high[k] = c.high;
  group.first_pixel[k] = static_cast<float>(c.first_pixel);
  group.last_pixel[k] = static_cast<float>(c.end_pixel - 1);
  group.weight[k] = c.weight;
  group.origin[k] = static_cast<int>(origin);
}

void put_pair(const LineCrossing& c, int pair, std::size_t k, CrossingGroup& group) {
  group.inverse[k] = 1.0f / c.step;
  group.bias[k] = -c.offset * group.inverse[k] - std::abs(group.inverse[k]);
  group.skipped[k] = static_cast<float>(2 * pair + 1);
}

// Returns the group of crossing number `count`; starts a new group for every four.
CrossingGroup& group_of(std::size_t count, std::vector<CrossingGroup>& groups) {
  if (count % kMax == 0) groups.emplace_back();
  return groups.back();
}

void include(Range whole, Range reached, std::size_t k, CrossingGroup& group) {
  group.whole = k == 0 ? whole : group.whole.common_with(whole);
  group.reached = k == 0 ? reached : group.reached.joined_with(reached);
}

// Fills the last group with copies of its last crossing without weight, whose memory is readable.
void fill_up(std::size_t count, std::vector<CrossingGroup>& groups) {
  if (count % kMax == 0) return;
  CrossingGroup& g = groups.back();
  for (std::size_t last = count % kMax - 1, k = last + 1; k < kMax; ++k) {
    for (auto numbers :
         {&CrossingGroup::offset, &CrossingGroup::step, &CrossingGroup::low, &CrossingGroup::high,
          &CrossingGroup::first_pixel, &CrossingGroup::last_pixel, &CrossingGroup::inverse,
          &CrossingGroup::bias, &CrossingGroup::skipped})
      (g.*numbers)[k] = (g.*numbers)[last];
    g.origin[k] = g.origin[last];
    g.weight[k] = 0.0f;
  }
}

}  // namespace

void group_lines(std::span<const LineCrossing> lines, const float* source,
                 std::vector<CrossingGroup>& groups) {
  std::size_t count = 0;
  for (const LineCrossing& line : lines) {
    CrossingGroup& group = group_of(count, groups);
    if (count % kMax == 0)
      set_pixels(lines.subspan(count, std::min(kMax, lines.size() - count)), group);
    put(line, count++ % kMax, line.samples - source, group);
  }
  fill_up(count, groups);
}

void group_views(std::span<const LineCrossing> views, const float* source,
                 std::vector<CrossingGroup>& groups) {
  std::size_t count = 0;
  for (const LineCrossing& view : views) {
    if (view.first_pixel >= view.end_pixel) continue;
    const int pairs = pairs_a_sample(view);
    const Range inner = samples_within(view), reached{inner.begin - 2, inner.end + 2};
    const Range whole = pairs == 1 ? inner : Range{};
    for (int pair = 0; pair < pairs; ++pair) {
      CrossingGroup& group = group_of(count, groups);
      const std::size_t k = count++ % kMax;
      put(view, k, view.detector - source, group);
      put_pair(view, pair, k, group);
      include(whole, reached, k, group);
    }
  }
  fill_up(count, groups);
}

}  // namespace tomofield::kernels
