#pragma once

#include <vector>

#include "measurement/halves.h"
#include "reconstruct/run.h"

namespace tomofield::reconstruction {

inline const char* name_of(tilt_series::Half half) {
  return half == tilt_series::Half::kEven ? "even" : "odd";
}

/// Returns one half of the frames or of the tilts, as the options say. Every process calls it.
measurement::Measurement half_measurement(const tilt_series::TiltSeries& series,
                                          tilt_series::Half half, const Run& run);

/// Turns the models of the views of the series into those of a half.
std::vector<measurement::ViewModel> views_of_half(const std::vector<measurement::ViewModel>& views,
                                                  const Run& run);

}  // namespace tomofield::reconstruction
