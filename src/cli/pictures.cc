#include "cli/pictures.h"

#include <fmt/core.h>

#include <cstdint>
#include <vector>

#include "base/parallel.h"
#include "base/trace.h"
#include "output/model_file.h"
#include "report/pictures.h"
#include "report/slice.h"

namespace tomofield::cli {

void write_pictures(const std::filesystem::path& volume, const tilt_series::TiltSeries& series,
                    tilt_series::BeadMasking bead_masking, const std::filesystem::path& prefix) {
  const base::TraceSpan span("draw pictures");
  std::vector<std::filesystem::path> slices;
  const std::filesystem::path mask = prefix.string() + "_mask.png";
  base::parallel_for("draw pictures", 2, [&](std::int64_t i) {
    if (i == 0)
      slices = report::write_slice_pictures(volume, prefix);
    else
      report::write_mask_picture(series, bead_masking, mask);
  });
  fmt::print("pictures ");
  for (const std::filesystem::path& picture : slices) fmt::print(" {}", picture.string());
  fmt::print(" {}\n", mask.string());
}

void write_tree_picture(const std::filesystem::path& model, const std::filesystem::path& picture) {
  const base::TraceSpan span("draw tree");
  report::write_tree_picture(output::load_model(model), picture);
  fmt::print("tree      {}\n", picture.string());
}

}  // namespace tomofield::cli
