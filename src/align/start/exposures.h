#pragma once

#include <vector>

#include "distributed/communicator.h"
#include "measurement/measurement.h"

namespace tomofield::alignment {

/// Sums over the rays of a view, which has any unit.
struct ViewSums {
  double n = 0.0, values = 0.0, squares = 0.0;

  double mean() const { return n > 0.0 ? values / n : 0.0; }
  double deviation() const;
};

/// Returns the sums [view] of a series. Every process calls it and gets the same.
std::vector<ViewSums> sums_of_views(const measurement::Measurement& measurement,
                                    const distributed::Communicator& processes);

/// Returns true if the views of a series differ in exposure: if the mean of a view typically
/// differs from that of its two neighbours in tilt by more than a part of a view's contrast. Every
/// process calls it and gets the same.
bool exposures_differ(const measurement::Measurement& measurement,
                      const distributed::Communicator& processes);

}  // namespace tomofield::alignment
