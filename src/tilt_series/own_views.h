#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/range.h"
#include "base/threads/parallel.h"
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

/// Returns how many views may be in memory at once for a short time, at least one, if each takes
/// `bytes_a_view`. Together they take a quarter of the memory that is available now, or a gibibyte.
/// The processes of a machine share it.
std::size_t views_at_once(std::size_t bytes_a_view, const distributed::Communicator& processes);

/// Calls body(view) for each of these views on all threads, at most `at_once` views at a time.
/// `what` names the loop in a trace.
template <typename Body>
void for_views(const char* what, std::span<const std::size_t> views, std::size_t at_once,
               const Body& body) {
  const bool fits = at_once >= static_cast<std::size_t>(base::thread_count());
  const std::size_t batch = fits ? std::max<std::size_t>(views.size(), 1) : at_once;
  for (std::size_t first = 0; first < views.size(); first += batch) {
    const std::size_t count = std::min(batch, views.size() - first);
    base::parallel_for(what, static_cast<std::int64_t>(count),
                       [&](std::int64_t i) { body(views[first + static_cast<std::size_t>(i)]); });
  }
}

}  // namespace tomofield::tilt_series
