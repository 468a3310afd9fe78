#include "cli/pictures.h"

#include <fmt/core.h>

#include "report/mask_picture.h"
#include "report/slices.h"

namespace tomofield::cli {

void write_pictures(const std::filesystem::path& volume, const tilt_series::TiltSeries& series,
                    const std::filesystem::path& prefix) {
  fmt::print("pictures ");
  for (const std::filesystem::path& picture : report::write_slice_pictures(volume, prefix)) {
    fmt::print(" {}", picture.string());
  }
  const std::filesystem::path mask = prefix.string() + "_mask.png";
  report::write_mask_picture(series, mask);
  fmt::print(" {}\n", mask.string());
}

}  // namespace tomofield::cli
