#include "cli/pictures.h"

#include <fmt/core.h>

#include "base/trace.h"
#include "output/model_file.h"
#include "report/pictures.h"
#include "report/slice.h"

namespace tomofield::cli {

void write_pictures(const std::filesystem::path& volume, const tilt_series::TiltSeries& series,
                    const std::filesystem::path& prefix) {
  const base::TraceSpan span("draw pictures");
  fmt::print("pictures ");
  for (const std::filesystem::path& picture : report::write_slice_pictures(volume, prefix)) {
    fmt::print(" {}", picture.string());
  }
  const std::filesystem::path mask = prefix.string() + "_mask.png";
  report::write_mask_picture(series, mask);
  fmt::print(" {}\n", mask.string());
}

void write_tree_picture(const std::filesystem::path& model, const std::filesystem::path& picture) {
  const base::TraceSpan span("draw tree");
  report::write_tree_picture(output::load_model(model), picture);
  fmt::print("tree      {}\n", picture.string());
}

}  // namespace tomofield::cli
