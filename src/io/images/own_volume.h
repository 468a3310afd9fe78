#pragma once

#include <algorithm>
#include <string>

#include "io/images/mrc.h"

namespace tomofield::io {

/// Returns true for the header of a volume that this program has written, which is no tilt series.
inline bool is_own_volume(const MrcHeader& header) {
  return header.is_volume && std::ranges::any_of(header.labels, [](const std::string& label) {
           return label.starts_with("tomofield ");
         });
}

}  // namespace tomofield::io
