#include "tilt_series/own_views.h"

#include "base/system/memory.h"

namespace tomofield::tilt_series {

std::size_t views_at_once(std::size_t bytes_a_view, const distributed::Communicator& processes) {
  constexpr std::size_t kAlways = std::size_t{1} << 30;
  const std::size_t memory = std::max(base::available_memory() / 4, kAlways) /
                             static_cast<std::size_t>(processes.size_on_machine());
  return std::max<std::size_t>(memory / std::max<std::size_t>(bytes_a_view, 1), 1);
}

}  // namespace tomofield::tilt_series
