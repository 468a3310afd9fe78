#include "measurement/ctf_correction.h"

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/threads/parallel.h"
#include "measurement/surrogate_views.h"

namespace tomofield::measurement {
namespace {

// Returns the rays of a view [y, x]; their mean stands for those that do not count.
std::vector<float> filled_view(const SlabViews& rays, int view) {
  const SlabViews::Shape& shape = rays.shape();
  std::vector<float> image;
  std::vector<std::size_t> missing;
  double sum = 0.0;
  for (std::int64_t y = 0; y < shape.num_rows; ++y)
    for (std::int64_t x = 0; x < shape.width; ++x) {
      if (!rays.counts(view, x, y)) missing.push_back(image.size());
      image.push_back(rays.counts(view, x, y) ? rays.ray(view, x, y) : 0.0f);
      sum += static_cast<double>(image.back());
    }
  const std::size_t measured = image.size() - missing.size();
  const double mean = measured > 0 ? sum / static_cast<double>(measured) : 0.0;
  for (const std::size_t i : missing) image[i] = static_cast<float>(mean);
  return image;
}

}  // namespace

void correct_ctf(microscope::CtfCorrection correction, Measurement& measurement) {
  const std::shared_ptr<const SlabViews> rays = measurement.rays;
  const std::vector<microscope::ViewFilter> filters = view_filters(measurement);
  std::shared_ptr<SlabViews> corrected = rays->blank(rays->shape().num_views);
  base::parallel_for("correct contrast transfer", std::ssize(filters), [&](std::int64_t i) {
    const int view = static_cast<int>(i);
    corrected->set_view(
        view, filters[static_cast<std::size_t>(i)].corrected(filled_view(*rays, view), correction));
  });
  corrected->hide_where_hidden(*rays);
  measurement.rays = corrected;
  measurement.transfers.clear();
}

}  // namespace tomofield::measurement
