#include "base/check.h"

#include <fmt/format.h>

#include "tomofield/error.h"

namespace tomofield::base {

void require_no_faults(const std::vector<std::string>& faults) {
  if (!faults.empty()) throw Error(fmt::format("{}", fmt::join(faults, "; ")));
}

}  // namespace tomofield::base
