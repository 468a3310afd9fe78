#include "baseline/neural/tensorf.h"

#include <fmt/format.h>

#include <algorithm>

#include "fit/stages.h"
#include "kernels/lanes.h"
#include "tomofield/error.h"

namespace tomofield::baseline {

Options tensorf_defaults() {
  const fit::FieldOptions field;
  const fit::FitOptions fit;
  Options options;
  options.field = FieldKind::kVm;
  options.rank = 48;
  options.epochs = fit.epochs;
  options.vertex_epochs = 0;
  options.coarse_epochs = fit::usual_schedule(field, fit).coarse_epochs_of(fit.epochs);
  options.coarse_bin = 8;
  options.learning_rate = fit.learning_rate;
  options.penalty = Penalty::kSmooth;
  options.density_variation = objective::usual_variation(Penalty::kSmooth);
  options.boundary = 0;
  return options;
}

int one_node_size(const Rectangle& roi, int coarse_bin) {
  constexpr std::int64_t kMaxSize = 4096;
  const std::int64_t side = std::max(roi.width(), roi.height());
  if (side > kMaxSize) {
    throw Error(
        fmt::format("the region of {} × {} pixels is too large for one node, which covers at most "
                    "{}: give a smaller --roi or a larger --bin",
                    roi.width(), roi.height(), kMaxSize));
  }
  std::int64_t step = std::int64_t{kernels::kLanes} * coarse_bin;
  while (step > kernels::kLanes && step > side) step /= 2;
  return static_cast<int>((side + step - 1) / step * step);
}

}  // namespace tomofield::baseline
