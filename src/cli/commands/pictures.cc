#include "cli/commands/pictures.h"

#include <cstdint>
#include <vector>

#include "base/threads/parallel.h"
#include "base/trace.h"
#include "cli/terminal/console.h"
#include "report/pictures.h"
#include "report/slice.h"

namespace tomofield::cli {

std::vector<std::filesystem::path> write_pictures(const std::filesystem::path& volume,
                                                  const tilt_series::TiltSeries& series,
                                                  tilt_series::BeadMasking bead_masking,
                                                  const std::filesystem::path& prefix) {
  const base::TraceSpan span("draw pictures");
  std::vector<std::filesystem::path> pictures;
  const std::filesystem::path mask = prefix.string() + "_mask.png";
  base::parallel_for("draw pictures", 2, [&](std::int64_t i) {
    if (i == 0)
      pictures = report::write_slice_pictures(volume, prefix);
    else
      report::write_mask_picture(series, bead_masking, mask);
  });
  pictures.push_back(mask);
  return pictures;
}

void print_pictures(const std::vector<std::filesystem::path>& pictures) {
  print("pictures ");
  for (const std::filesystem::path& picture : pictures) print(" {}", picture.string());
  print("\n");
}

}  // namespace tomofield::cli
