#pragma once

#include "base/lanes.h"

namespace tomofield::kernels {

using base::kLanes;

}  // namespace tomofield::kernels
