#include "baseline/neural/tensorf.h"

#include <fmt/format.h>

#include <algorithm>

#include "fit/stages.h"
#include "kernels/lanes.h"
#include "tomofield/error.h"

namespace tomofield::baseline {

reconstruction::ReconstructOptions tensorf_options() {
  reconstruction::ReconstructOptions options;
  options.field.depth = 0;
  options.field.rank = 48;
  options.fit.coarse_epochs =
      fit::usual_schedule(options.field, options.fit).coarse_epochs_of(options.fit.epochs);
  options.fit.coarse_bin = 8;
  options.fit.penalty = Penalty::kSmooth;
  options.fit.density_variation = objective::usual_variation(options.fit.penalty);
  options.fit.boundary = 0;
  return options;
}

void cover_with_one_node(const Rectangle& roi, reconstruction::ReconstructOptions& options) {
  constexpr std::int64_t kLargest = 4096;
  const std::int64_t side = std::max(roi.width(), roi.height());
  if (side > kLargest) {
    throw Error(
        fmt::format("the region of {} × {} pixels is too large for one node, which covers at most "
                    "{}: give a smaller --roi or a larger --bin",
                    roi.width(), roi.height(), kLargest));
  }
  // Slabs of the coarsest pixels must end with the node. A small region bins fewer pixels.
  std::int64_t step = std::int64_t{kernels::kLanes} * options.fit.coarse_bin;
  while (step > kernels::kLanes && step > side) step /= 2;
  options.field.leaf_size = static_cast<int>((side + step - 1) / step * step);
}

}  // namespace tomofield::baseline
