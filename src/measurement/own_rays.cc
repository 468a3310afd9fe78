#include "measurement/own_rays.h"

#include <memory>
#include <numeric>
#include <vector>

#include "base/check.h"

namespace tomofield::measurement {

SlabViews& own_rays(Measurement& measurement) {
  TOMOFIELD_CHECK(measurement.rays.use_count() == 1, "a copy of the measurement shares its rays");
  // Nobody else sees these rays, which were not made constant.
  return *std::const_pointer_cast<SlabViews>(measurement.rays);
}

Measurement with_own_rays(const Measurement& measurement) {
  std::vector<int> views(static_cast<std::size_t>(measurement.geometry.num_views()));
  std::iota(views.begin(), views.end(), 0);
  Measurement copy = measurement;
  copy.rays =
      measurement.rays->rows({0, static_cast<int>(measurement.rays->shape().num_rows)}, views);
  return copy;
}

}  // namespace tomofield::measurement
