#include "reconstruct/stages.h"

#include <algorithm>
#include <cmath>

#include "base/lanes.h"

namespace tomofield::reconstruct {
namespace {

// The largest power of two up to coarse_bin at which no slab straddles two leaves.
int coarse_bin(const FieldOptions& field, const FitOptions& fit) {
  if (fit.coarse_epochs == 0 || fit.engine != "slab") return 1;
  const bool may_halve = field.tree == "adaptive" && field.leaf_size % (2 * base::kLanes) == 0;
  const int smallest_leaf = may_halve ? field.leaf_size / 2 : field.leaf_size;
  int bin = 1;
  while (2 * bin <= fit.coarse_bin && smallest_leaf % (2 * bin * base::kLanes) == 0) bin *= 2;
  return bin;
}

}  // namespace

int Schedule::coarse_epochs_of(int fine) const {
  constexpr double kCoarseEpochs = 80;  // before the usual ones
  return static_cast<int>(std::clamp(std::round(kCoarseEpochs / epochs * fine), 0.0, 1e9));
}

Schedule usual_schedule(const FieldOptions& field, const FitOptions& fit) {
  Schedule schedule{30, 0.05};
  if (field.kind == "grid") schedule = {10, 0.035};
  const int bin = coarse_bin(field, fit);
  if (bin > 1 && field.finest_spacing() >= bin) schedule.epochs = 5;
  return schedule;
}

std::vector<Stage> make_stages(const FieldOptions& field, const FitOptions& fit) {
  std::vector<int> bins;
  for (int bin = coarse_bin(field, fit); bin > 1 && std::ssize(bins) < fit.coarse_stages; bin /= 2)
    bins.push_back(bin);
  std::vector<Stage> stages;
  std::int64_t first_epoch = 0;
  double first_rate = fit.learning_rate;
  for (int left = static_cast<int>(bins.size()); left > 0; --left) {
    const int epochs = static_cast<int>((fit.coarse_epochs - first_epoch) / left);
    stages.push_back({bins[bins.size() - static_cast<std::size_t>(left)], first_epoch, epochs,
                      first_rate, fit.learning_rate * fit.coarse_final_rate});
    first_epoch += epochs;
    first_rate = fit.learning_rate * fit.refined_rate;
  }
  stages.push_back({1, first_epoch, fit.epochs, first_rate, fit.learning_rate * fit.final_rate});
  return stages;
}

}  // namespace tomofield::reconstruct
