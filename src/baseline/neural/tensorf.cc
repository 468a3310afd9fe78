#include "baseline/neural/tensorf.h"

#include <fmt/format.h>

#include <algorithm>

#include "fit/stages.h"
#include "kernels/lanes.h"
#include "measurement/prepare.h"
#include "objective/constants.h"
#include "tomofield/error.h"

namespace tomofield::baseline {

Options tensorf_defaults() {
  const FieldOptions field;
  const FitOptions fit;
  Options options;
  options.field.kind.derive(FieldKind::kVm);
  options.field.rank.derive(48);
  options.fit.epochs.derive(fit.epochs);
  options.fit.vertex_epochs.derive(0);
  options.fit.coarse_epochs.derive(fit::usual_schedule(field, fit).coarse_epochs_of(fit.epochs));
  options.fit.coarse_bin = 8;
  options.fit.learning_rate.derive(fit.learning_rate);
  options.fit.penalty.derive(Penalty::kSmooth);
  options.fit.density_variation.derive(objective::usual_variation(Penalty::kSmooth));
  options.fit.boundary = 0;
  return options;
}

int one_node_size(const Rectangle& roi, int coarse_bin) {
  constexpr std::int64_t kMaxSize = 4096;
  constexpr std::int64_t kLeastSize = 64;  // smaller leaves share a cell (fit::depth_of())
  const std::int64_t side = std::max(roi.width(), roi.height());
  if (side > kMaxSize) {
    throw Error(
        fmt::format("the region of {} × {} pixels is too large for one node, which covers at most "
                    "{}: give a smaller --roi or a larger --bin",
                    roi.width(), roi.height(), kMaxSize));
  }
  std::int64_t step = std::int64_t{kernels::kLanes} * coarse_bin;
  while (step > kernels::kLanes && step > side) step /= 2;
  return static_cast<int>(std::max(kLeastSize, (side + step - 1) / step * step));
}

int one_node_size(const tilt_series::PlannedSeries& series, const Options& options) {
  return one_node_size(measurement::plan_measurement(series, options.specimen).roi,
                       options.fit.coarse_bin);
}

}  // namespace tomofield::baseline
