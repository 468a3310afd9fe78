#include "verdict/likeness_order.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "base/statistics.h"
#include "base/threads/parallel.h"

namespace tomofield::verdict {
namespace {

using evaluate::Image;

// Fewer views are too far apart to tell an order: with 8 of them, those of correct series are no
// more alike than those of some shuffled ones.
constexpr int kFewestOrderedViews = 12;
// Pixels by which the small images may be moved where they are compared, so that a stack that is
// not aligned has its order all the same.
constexpr std::int64_t kReach = 4;
// How alike views are that are noise to the eye, in units of the deviation of correlations of white
// noise, 1 / √pixels: the median of all pairs is 2.9 to 3.3 there (it is that of the best of many
// shifts) and 7 or more for views of which one sees something, and the most alike pair stands above
// the median by 2.8 or less, and by 5.4 and more if neighbours can be told, also of shuffled views.
constexpr double kMedianOfNoise = 5.0, kStandsOut = 3.7;

// Says whether the likenesses of all pairs of images of that many pixels are those of noise.
bool is_of_noise(const std::vector<double>& likeness, std::size_t num_pixels) {
  const double deviation = 1 / std::sqrt(static_cast<double>(num_pixels));
  const double median = base::median({likeness.begin(), likeness.end()});
  return median < kMedianOfNoise * deviation &&
         std::ranges::max(likeness) - median < kStandsOut * deviation;
}

}  // namespace

std::optional<double> order_by_likeness(const std::vector<Image>& images) {
  if (std::ssize(images) < kFewestOrderedViews) return std::nullopt;
  std::vector<std::vector<double>> likeness(images.size());  // [a][b − a − 1]
  base::parallel_for("compare views in pairs", std::ssize(images), [&](std::int64_t i) {
    const auto a = static_cast<std::size_t>(i);
    for (std::size_t b = a + 1; b < images.size(); ++b)
      likeness[a].push_back(evaluate::shifted_correlation(images[a], images[b], kReach));
  });
  std::vector<double> neighbours, others;
  for (const std::vector<double>& of_image : likeness) {
    if (of_image.empty()) continue;
    neighbours.push_back(of_image.front());
    others.insert(others.end(), of_image.begin() + 1, of_image.end());
  }
  std::vector<double> all = others;
  all.insert(all.end(), neighbours.begin(), neighbours.end());
  if (is_of_noise(all, images.front().values.size())) return std::nullopt;
  double greater = 0;
  for (const double of_neighbours : neighbours)
    greater += static_cast<double>(
        std::ranges::count_if(others, [&](double other) { return of_neighbours > other; }));
  return greater / static_cast<double>(neighbours.size() * others.size());
}

}  // namespace tomofield::verdict
