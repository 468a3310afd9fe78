#pragma once

#include "distributed/communicator.h"
#include "measurement/measurement.h"

namespace tomofield::alignment {

/// Returns true if the views of a series differ in exposure: if the mean of a view typically
/// differs from that of its two neighbours in tilt by more than a part of a view's contrast. Every
/// process calls it and gets the same.
bool exposures_differ(const measurement::Measurement& measurement,
                      const distributed::Communicator& processes);

}  // namespace tomofield::alignment
