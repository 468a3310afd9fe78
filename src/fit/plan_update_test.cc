#include "fit/plan_update.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/random.h"
#include "fit/integer_program.h"

namespace tomofield::fit {
namespace {

using field::Quadtree;
using field::QuadtreeEdit;
using field::Region;
using field::RootGrid;

// Makes cells of the region of interest, some split at random, with a margin cell at each end.
Quadtree random_tree(base::Random& random, int columns, int num_splits) {
  std::vector<Region> regions(static_cast<std::size_t>(columns), Region::kInterest);
  regions.front() = regions.back() = Region::kMargin;
  Quadtree tree(RootGrid{.x0 = 0, .y0 = 0, .cell_size = 64, .columns = columns, .rows = 1},
                regions);
  for (int n = 0; n < num_splits; ++n) {
    const int leaf = static_cast<int>(random.below(static_cast<std::uint64_t>(tree.num_leaves())));
    if (tree.leaf(leaf).square.size > 16) tree.split(leaf);
  }
  return tree;
}

std::vector<double> random_errors(base::Random& random, int count) {
  std::vector<double> errors;
  for (int i = 0; i < count; ++i)
    errors.push_back(random.below(8) == 0 ? 0.0 : random.uniform(0.0, 2.0));
  return errors;
}

int num_active(const Quadtree& tree) {
  int count = 0;
  for (int i = 0; i < tree.num_leaves(); ++i) count += tree.leaf(i).region == Region::kInterest;
  return count;
}

int leaves_after(const Quadtree& tree, const QuadtreeEdit& edit) {
  return num_active(tree) +
         3 * (static_cast<int>(edit.split.size()) - static_cast<int>(edit.merge.size()));
}

// Finds the smallest predicted error and number of leaves of all possible edits, node by node.
class BruteForce {
 public:
  BruteForce(const Quadtree& tree, const std::vector<double>& errors, const PlanOptions& options)
      : tree_(tree), errors_(errors), options_(options) {
    for (int i = 0; i < tree.num_leaves(); ++i) {
      if (tree.leaf(i).region == Region::kInterest) error_ += errors[static_cast<std::size_t>(i)];
    }
    visit(0, num_active(tree), error_);
    const auto reachable = [](double e) { return std::isfinite(e); };
    fewest_ = static_cast<int>(std::find_if(best_.begin(), best_.end(), reachable) - best_.begin());
  }

  int fewest() const { return fewest_; }
  double best(int budget) const {
    double least = std::numeric_limits<double>::infinity();
    for (int n = 0; n <= std::max(budget, fewest_) && n < static_cast<int>(best_.size()); ++n)
      least = std::min(least, best_[static_cast<std::size_t>(n)]);
    return least;
  }

 private:
  // Leaf i is kept or split, or it and its three siblings are merged.
  void visit(int i, int leaves, double error) {
    if (i == tree_.num_leaves()) {
      if (leaves >= static_cast<int>(best_.size()))
        best_.resize(static_cast<std::size_t>(leaves) + 1, std::numeric_limits<double>::infinity());
      double& best = best_[static_cast<std::size_t>(leaves)];
      best = std::min(best, error);
      return;
    }
    visit(i + 1, leaves, error);
    const field::QuadtreeNode& leaf = tree_.leaf(i);
    if (leaf.region != Region::kInterest) return;
    if (leaf.square.size / 2 >= options_.min_size)
      visit(i + 1, leaves + 3,
            error - (1 - options_.split_factor) * errors_[static_cast<std::size_t>(i)]);
    if (leaf.level == 0 || i + 3 >= tree_.num_leaves()) return;
    double sum = 0;
    for (int c = 0; c < 4; ++c) {
      if (tree_.leaf(i + c).parent != leaf.parent) return;
      sum += errors_[static_cast<std::size_t>(i + c)];
    }
    visit(i + 4, leaves - 3, error + (options_.merge_factor - 1) * sum);
  }

  const Quadtree& tree_;
  const std::vector<double>& errors_;
  const PlanOptions& options_;
  double error_ = 0.0;
  int fewest_ = 0;
  std::vector<double> best_;  // of each number of leaves
};

class PlanUpdate : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!can_solve_integer_programs()) GTEST_SKIP() << "this build is without COIN-OR CBC";
  }
};

TEST_F(PlanUpdate, IsOptimalOnRandomTrees) {
  base::Random random(7);
  for (int n = 0; n < 120; ++n) {
    const Quadtree tree = random_tree(random, 4, static_cast<int>(random.below(4)));
    const auto errors = random_errors(random, tree.num_leaves());
    PlanOptions options;
    options.split_factor = random.uniform(0.2, 0.9);
    options.merge_factor = random.uniform(1.01, 2.0);
    options.min_size = random.below(2) == 0 ? 16 : 32;
    const BruteForce oracle(tree, errors, options);
    for (const int room : {-30, -6, -3, -1, 0, 1, 2, 3, 7, 1000}) {
      options.budget = num_active(tree) + room;
      const Plan plan = plan_update(tree, errors, options);
      EXPECT_NEAR(plan.predicted_error, oracle.best(options.budget), 1e-4) << n << ' ' << room;
      EXPECT_LE(leaves_after(tree, plan.edit), std::max(options.budget, oracle.fewest()));
      // The plan is a valid edit of this tree, and a second plan is equal.
      EXPECT_EQ(field::edit_tree(tree, plan.edit).tree.num_leaves(),
                leaves_after(tree, plan.edit) + tree.num_leaves() - num_active(tree));
      EXPECT_EQ(plan_update(tree, errors, options).edit, plan.edit);
    }
  }
}

Quadtree even_tree(int level) {
  Quadtree tree(RootGrid{.x0 = 0, .y0 = 0, .cell_size = 128, .columns = 2, .rows = 1},
                {Region::kInterest, Region::kMargin});
  tree.split_to_level(Region::kInterest, level);
  return tree;
}

TEST_F(PlanUpdate, SpendsWhatFlatLeavesDoNotNeed) {
  const Quadtree tree = even_tree(2);  // 16 leaves of 32 px
  std::vector<double> errors(17, 0.001);
  errors[5] = errors[6] = 1.0;
  errors[16] = 100.0;  // in the margin
  const Plan plan = plan_update(tree, errors, {.budget = 16});
  EXPECT_EQ(plan.edit.split, (std::vector<int>{5, 6}));
  EXPECT_EQ(plan.edit.merge.size(), 2u);
  EXPECT_NEAR(plan.predicted_error, 2 * 0.75 + 6 * 0.001 + 8 * 0.0011, 1e-12);
}

TEST_F(PlanUpdate, ChangesNothingWithoutAGain) {
  const Quadtree tree = even_tree(1);
  EXPECT_TRUE(plan_update(tree, std::vector<double>(5, 0.0), {.budget = 100}).edit.is_empty());
  EXPECT_TRUE(plan_update(tree, std::vector<double>(5, 1.0), {.budget = 4}).edit.is_empty());
  EXPECT_TRUE(plan_update(tree, std::vector<double>(5, 1.0), {.budget = 6}).edit.is_empty());
  EXPECT_EQ(plan_update(tree, std::vector<double>(5, 1.0), {.budget = 7}).edit.split.size(), 1u);
}

// Quarters of 24 px would straddle slabs.
TEST_F(PlanUpdate, KeepsMultiplesOfASlab) {
  Quadtree tree(RootGrid{.x0 = 0, .y0 = 0, .cell_size = 96, .columns = 1, .rows = 1},
                {Region::kInterest});
  EXPECT_EQ(plan_update(tree, {1.0}, {.budget = 100}).edit.split.size(), 1u);
  tree.split(0);
  EXPECT_TRUE(plan_update(tree, std::vector<double>(4, 1.0), {.budget = 100}).edit.is_empty());
}

TEST_F(PlanUpdate, ComesAsCloseToATightBudgetAsOneEditCan) {
  const Quadtree tree = even_tree(2);
  const std::vector<double> errors(17, 1.0);
  const Plan plan = plan_update(tree, errors, {.budget = 1});
  EXPECT_EQ(plan.edit.merge.size(), 4u);
  EXPECT_TRUE(plan.edit.split.empty());
}

TEST_F(PlanUpdate, IsQuickForAThousandLeaves) {
  Quadtree tree(RootGrid{.x0 = 0, .y0 = 0, .cell_size = 64, .columns = 16, .rows = 16},
                std::vector<Region>(256, Region::kInterest));
  tree.split_to_level(Region::kInterest, 1);
  base::Random random(2);
  const auto errors = random_errors(random, tree.num_leaves());
  const Plan plan = plan_update(tree, errors, {.budget = 1024});
  EXPECT_EQ(plan.edit.split.size(), plan.edit.merge.size());
  EXPECT_GT(plan.edit.split.size(), 20u);
}

}  // namespace
}  // namespace tomofield::fit
