#include "shared_data.h"

namespace tomofield::testing {

std::filesystem::path shared_data() {
  return std::filesystem::path(TOMOFIELD_SHARED_DATA) / "data";
}

}  // namespace tomofield::testing
