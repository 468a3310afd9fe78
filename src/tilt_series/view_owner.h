#pragma once

#include <cstddef>
#include <vector>

#include "base/range.h"
#include "distributed/communicator.h"

namespace tomofield::tilt_series {

/// Views are dealt to the processes of a job in turn: each view has one owner, which decodes it.
inline int owner_of_view(std::size_t view, const distributed::Communicator& processes) {
  return static_cast<int>(view % static_cast<std::size_t>(processes.size()));
}
inline bool is_own_view(std::size_t view, const distributed::Communicator& processes) {
  return owner_of_view(view, processes) == processes.rank();
}
/// Returns the views that this process owns, of a range of them.
inline std::vector<std::size_t> own_views(base::Range views,
                                          const distributed::Communicator& processes) {
  std::vector<std::size_t> own;
  for (int view = views.begin; view < views.end; ++view)
    if (is_own_view(static_cast<std::size_t>(view), processes))
      own.push_back(static_cast<std::size_t>(view));
  return own;
}
/// Returns how many views the process with the most of them owns.
inline std::size_t max_own_views(std::size_t num_views,
                                 const distributed::Communicator& processes) {
  const auto size = static_cast<std::size_t>(processes.size());
  return (num_views + size - 1) / size;
}

}  // namespace tomofield::tilt_series
