#include "fit/tree_updates.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <utility>

#include "base/random.h"
#include "base/threads/parallel.h"
#include "fit/plan_update.h"

namespace tomofield::fit {
namespace {

constexpr std::int64_t kEpochsBetweenUpdates = 2;
constexpr int kBoxesX = 8, kBoxesY = 8, kBoxesZ = 16;

// Returns a random stream of its own for each square and pass.
base::Random random_of(const field::Square& square, std::uint64_t seed, std::uint64_t pass) {
  std::uint64_t stream = pass;
  for (const std::int64_t part : {square.x0, square.y0, square.size})
    stream = base::Random(stream, static_cast<std::uint64_t>(part)).bits();
  return base::Random(seed, stream);
}

// Returns the standard deviation of the density at random points of a square.
double deviation(const field::Field& field, const field::Square& square, base::Random random) {
  const double width = static_cast<double>(square.size);
  double sum = 0.0, squares = 0.0;
  for (int k = 0; k < kBoxesZ; ++k) {
    for (int j = 0; j < kBoxesY; ++j) {
      for (int i = 0; i < kBoxesX; ++i) {
        const double x = field::kPixelCentre + static_cast<double>(square.x0) +
                         width * (i + random.uniform()) / kBoxesX;
        const double y = field::kPixelCentre + static_cast<double>(square.y0) +
                         width * (j + random.uniform()) / kBoxesY;
        const double z = field.thickness() * (k + random.uniform()) / kBoxesZ;
        const double density = field.density(x, y, z);
        sum += density;
        squares += density * density;
      }
    }
  }
  constexpr double kPoints = kBoxesX * kBoxesY * kBoxesZ;
  const double mean = sum / kPoints;
  return std::sqrt(std::max(squares / kPoints - mean * mean, 0.0));
}

}  // namespace

std::vector<double> leaf_errors(const field::Field& field, std::uint64_t seed, std::uint64_t pass) {
  const field::Quadtree& tree = field.tree();
  std::vector<double> errors(static_cast<std::size_t>(tree.num_leaves()));
  base::parallel_for("rate leaves", tree.num_leaves(), [&](std::int64_t i) {
    const field::QuadtreeNode& leaf = tree.leaf(static_cast<int>(i));
    if (leaf.region != field::Region::kInterest) return;
    errors[static_cast<std::size_t>(i)] =
        deviation(field, leaf.square, random_of(leaf.square, seed, pass));
  });
  return errors;
}

void apply_edit(const field::QuadtreeEdit& edit, field::Field& field, Adam::State& optimizer) {
  const auto origins = field.edit(edit, {&optimizer.m, &optimizer.v});
  std::vector<std::int64_t> steps;
  for (const field::LeafOrigin& origin : origins) {
    const auto first = optimizer.leaf_steps.begin() + origin.leaf;
    const int count = origin.kind == field::LeafOrigin::Kind::kUnion ? 4 : 1;
    steps.push_back(*std::min_element(first, first + count));
  }
  optimizer.leaf_steps = std::move(steps);
}

std::int64_t open_epochs(const FieldOptions& field, const Stage& first) {
  // The tree may change in the coarse stage. Without one, it may change in this part of the fit.
  constexpr double kOpenPart = 0.4;
  if (field.tree == TreeKind::kUniform) return 0;
  return first.bin > 1 ? first.epochs - 1 : static_cast<std::int64_t>(kOpenPart * first.epochs);
}

bool tree_may_change(const FieldOptions& field, const Stage& first) {
  return open_epochs(field, first) >= kEpochsBetweenUpdates;
}

TreeUpdates::TreeUpdates(int min_size, int budget, std::int64_t open_epochs, std::uint64_t seed)
    : min_size_(min_size), budget_(budget), open_epochs_(open_epochs), seed_(seed) {}

bool TreeUpdates::update(std::int64_t epochs_done, field::Field& field, Adam::State& optimizer,
                         TreeProgress& progress) const {
  if (progress.is_frozen || epochs_done % kEpochsBetweenUpdates != 0) return false;
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
