#include "fit/tree_updates.h"

#include <algorithm>
#include <numeric>

#include "fit/apply_edit.h"
#include "fit/leaf_errors.h"
#include "fit/plan_update.h"

namespace tomofield::fit {
namespace {

constexpr std::int64_t kEpochsBetween = 2;

}  // namespace

TreeUpdates::TreeUpdates(int min_size, int budget, std::int64_t open_epochs, std::uint64_t seed)
    : min_size_(min_size), budget_(budget), open_epochs_(open_epochs), seed_(seed) {}

bool TreeUpdates::update(std::int64_t epochs_done, field::Field& field, Adam::State& optimizer,
                         TreeProgress& progress) const {
  if (progress.is_frozen || epochs_done % kEpochsBetween != 0) return false;
  if (epochs_done > open_epochs_) {
    progress.is_frozen = true;
    return false;
  }
  const std::vector<double> errors =
      leaf_errors(field, seed_, static_cast<std::uint64_t>(epochs_done));
  const Plan plan = plan_update(field.tree(), errors, {.budget = budget_, .min_size = min_size_});
  if (!plan.edit.is_empty()) apply_edit(plan.edit, field, optimizer);
  progress.is_frozen = plan.edit.is_empty();
  progress.updates.push_back({.epoch = epochs_done,
                              .splits = static_cast<std::int64_t>(plan.edit.split.size()),
                              .merges = static_cast<std::int64_t>(plan.edit.merge.size()),
                              .error = std::accumulate(errors.begin(), errors.end(), 0.0),
                              .predicted_error = plan.predicted_error,
                              .leaves_by_level = leaves_by_level(field.tree())});
  return !plan.edit.is_empty();
}

std::vector<std::int64_t> leaves_by_level(const field::Quadtree& tree) {
  std::vector<std::int64_t> counts;
  for (int i = 0; i < tree.num_leaves(); ++i) {
    const field::QuadtreeNode& leaf = tree.leaf(i);
    if (leaf.region != field::Region::kInterest) continue;
    const auto level = static_cast<std::size_t>(leaf.level);
    counts.resize(std::max(counts.size(), level + 1));
    ++counts[level];
  }
  return counts;
}

}  // namespace tomofield::fit
