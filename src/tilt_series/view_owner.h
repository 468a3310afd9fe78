#pragma once

#include <cstddef>

#include "distributed/communicator.h"

namespace tomofield::tilt_series {

/// Views are dealt to the processes of a job in turn: each view has one owner, which decodes it.
inline int owner_of_view(std::size_t view, const distributed::Communicator& processes) {
  return static_cast<int>(view % static_cast<std::size_t>(processes.size()));
}
inline bool is_own_view(std::size_t view, const distributed::Communicator& processes) {
  return owner_of_view(view, processes) == processes.rank();
}
/// Returns how many views the process with the most of them owns.
inline std::size_t max_own_views(std::size_t num_views,
                                 const distributed::Communicator& processes) {
  const auto size = static_cast<std::size_t>(processes.size());
  return (num_views + size - 1) / size;
}

}  // namespace tomofield::tilt_series
