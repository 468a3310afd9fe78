#include "measurement/measurement.h"

namespace tomofield::measurement {

// A mean over bin² pixels has a bin-th of their noise, and rays are a bin-th as long.
BinnedMeasurement::BinnedMeasurement(const Measurement& fine, int bin) : Measurement(fine) {
  if (bin == 1) return;
  own_rays_ = fine.rays->binned(bin);
  rays = own_rays_.get();
  geometry.width = rays->shape().width;
  geometry.height = rays->shape().height;
  geometry.thickness /= bin;
  geometry.axis_x /= bin;
  geometry.axis_z /= bin;
  for (double& sigma : noise_sigma) sigma /= bin * bin;
}

}  // namespace tomofield::measurement
