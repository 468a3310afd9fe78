#include "cli/pictures.h"

#include <fmt/core.h>

#include "report/slices.h"

namespace tomofield::cli {

void write_pictures(const std::filesystem::path& volume, const std::filesystem::path& prefix) {
  fmt::print("pictures ");
  for (const std::filesystem::path& picture : report::write_slice_pictures(volume, prefix)) {
    fmt::print(" {}", picture.string());
  }
  fmt::print("\n");
}

}  // namespace tomofield::cli
