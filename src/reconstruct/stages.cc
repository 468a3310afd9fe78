#include "reconstruct/stages.h"

#include <algorithm>
#include <cmath>

#include "base/lanes.h"

namespace tomofield::reconstruct {
namespace {

// Powers of two up to coarse_bin at which no slab straddles two leaves, at most one an epoch. An
// adaptive tree has one: its structure is open in the first stage, where that should see most.
std::vector<int> coarse_bins(const FieldOptions& field, const FitOptions& fit) {
  std::vector<int> bins;
  if (fit.engine != "slab") return bins;
  const bool is_adaptive = field.tree == "adaptive";
  const bool may_halve = is_adaptive && field.leaf_size % (2 * base::kLanes) == 0;
  const int smallest_leaf = may_halve ? field.leaf_size / 2 : field.leaf_size;
  const int most = is_adaptive ? std::min(fit.coarse_bin, 2) : fit.coarse_bin;
  for (int bin = 2; bin <= most && smallest_leaf % (bin * base::kLanes) == 0; bin *= 2) {
    if (std::ssize(bins) < fit.coarse_epochs) bins.push_back(bin);
  }
  return bins;
}

}  // namespace

int Schedule::coarse_epochs_of(int fine) const {
  constexpr double kCoarseEpochs = 80;
  const double part = std::clamp(static_cast<double>(fine) / epochs, 0.0, 1.0);
  return static_cast<int>(std::round(kCoarseEpochs * part));
}

Schedule usual_schedule(const FieldOptions& field, const FitOptions& fit) {
  Schedule schedule{30, 0.05};
  if (field.kind == "grid") schedule = {10, 0.035};
  const std::vector<int> bins = coarse_bins(field, fit);
  if (!bins.empty() && field.finest_spacing() >= bins.front()) schedule.epochs = 5;
  return schedule;
}

std::vector<Stage> make_stages(const FieldOptions& field, const FitOptions& fit) {
  const std::vector<int> bins = coarse_bins(field, fit);
  std::vector<Stage> stages;
  std::int64_t first_epoch = 0;
  double first_rate = fit.learning_rate;
  for (std::size_t left = bins.size(); left > 0; --left) {
    const int epochs = static_cast<int>((fit.coarse_epochs - first_epoch) / static_cast<int>(left));
    stages.push_back({bins[left - 1], first_epoch, epochs, first_rate,
                      fit.learning_rate * fit.coarse_final_rate});
    first_epoch += epochs;
    first_rate = fit.learning_rate * fit.refined_rate;
  }
  stages.push_back({1, first_epoch, fit.epochs, first_rate, fit.learning_rate * fit.final_rate});
  return stages;
}

}  // namespace tomofield::reconstruct
