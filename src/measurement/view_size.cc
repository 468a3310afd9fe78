#include "measurement/view_size.h"

#include <fmt/format.h>

#include <algorithm>

#include "tomofield/error.h"

namespace tomofield::measurement {

void require_pixels(std::int64_t width, std::int64_t height) {
  constexpr std::int64_t kFewest = 8;
  if (std::min(width, height) >= kFewest) return;
  throw Error(
      fmt::format("views of {} × {} pixels show nothing: they need at least {} along both sides, "
                  "after --bin; give a smaller --bin, or check the size in the stack's header",
                  width, height, kFewest));
}

}  // namespace tomofield::measurement
