#include "fit/plan_update.h"

#include <algorithm>
#include <cstddef>

#include "base/check.h"
#include "fit/integer_program.h"
#include "kernels/lanes.h"

namespace tomofield::fit {
namespace {

using field::Quadtree;
using field::QuadtreeNode;
using field::Region;

// A change has to gain this part of the mean error. Otherwise ties would swing to and fro between
// updates.
constexpr double kMinGain = 1e-6;

// Lists the possible changes of a tree; each is a variable of the program.
struct Candidates {
  std::vector<int> splits;                 // leaf numbers
  std::vector<int> merges;                 // node numbers
  std::vector<std::vector<int>> siblings;  // leaf numbers that each merge joins
  int num_active = 0;                      // leaves of the region of interest

  Candidates(const Quadtree& tree, const PlanOptions& options) {
    for (int i = 0; i < tree.num_leaves(); ++i) {
      const QuadtreeNode& leaf = tree.leaf(i);
      if (leaf.region != Region::kInterest) continue;
      ++num_active;
      if (leaf.square.size % (2 * kernels::kLanes) == 0 && leaf.square.size / 2 >= options.min_size)
        splits.push_back(i);
      // Siblings are four consecutive leaves with one parent.
      if (!starts_siblings(tree, i)) continue;
      merges.push_back(leaf.parent);
      siblings.push_back({i, i + 1, i + 2, i + 3});
    }
  }

  int size() const { return static_cast<int>(splits.size() + merges.size()); }
  int merge_variable(std::size_t group) const { return static_cast<int>(splits.size() + group); }

 private:
  static bool starts_siblings(const Quadtree& tree, int leaf) {
    const int parent = tree.leaf(leaf).parent;
    if (parent < 0 || leaf + 3 >= tree.num_leaves()) return false;
    for (int c = 0; c < 4; ++c) {
      if (tree.leaf(leaf + c).parent != parent) return false;
    }
    return true;
  }
};

// A split adds three leaves and a merge removes three, so the budget counts changes.
double budget_row_bound(const Candidates& candidates, int budget) {
  const int room = budget - candidates.num_active;
  const int changes = room >= 0 ? room / 3 : -((2 - room) / 3);  // rounded down
  return std::max(changes, -static_cast<int>(candidates.merges.size()));
}

IntegerProgram make_program(const Candidates& candidates, const std::vector<double>& errors,
                            const PlanOptions& options, double mean_error) {
  IntegerProgram program;
  IntegerProgram::Row budget{{}, budget_row_bound(candidates, options.budget)};
  std::vector<int> split_variable(errors.size(), -1);
  for (const int leaf : candidates.splits) {
    const int variable = static_cast<int>(program.costs.size());
    split_variable[static_cast<std::size_t>(leaf)] = variable;
    const double gain = (1 - options.split_factor) * errors[static_cast<std::size_t>(leaf)];
    program.costs.push_back(kMinGain - gain / mean_error);
    budget.terms.push_back({variable, 1.0});
  }
  for (std::size_t g = 0; g < candidates.merges.size(); ++g) {
    const int variable = candidates.merge_variable(g);
    double sum = 0.0;
    for (const int leaf : candidates.siblings[g]) {
      sum += errors[static_cast<std::size_t>(leaf)];
      const int split = split_variable[static_cast<std::size_t>(leaf)];
      if (split >= 0) program.rows.push_back({{{split, 1.0}, {variable, 1.0}}, 1.0});
    }
    program.costs.push_back(kMinGain + (options.merge_factor - 1) * sum / mean_error);
    budget.terms.push_back({variable, -1.0});
  }
  program.rows.push_back(std::move(budget));
  return program;
}

}  // namespace

Plan plan_update(const Quadtree& tree, const std::vector<double>& errors,
                 const PlanOptions& options) {
  TOMOFIELD_CHECK(static_cast<int>(errors.size()) == tree.num_leaves(), "one error a leaf");
  const Candidates candidates(tree, options);
  Plan plan;
  for (int i = 0; i < tree.num_leaves(); ++i) {
    if (tree.leaf(i).region == Region::kInterest)
      plan.predicted_error += errors[static_cast<std::size_t>(i)];
  }
  if (candidates.size() == 0) return plan;
  const double mean = plan.predicted_error / candidates.num_active;
  const std::vector<bool> chosen =
      solve(make_program(candidates, errors, options, mean > 0 ? mean : 1.0));
  for (std::size_t s = 0; s < candidates.splits.size(); ++s) {
    if (!chosen[s]) continue;
    const int leaf = candidates.splits[s];
    plan.edit.split.push_back(leaf);
    plan.predicted_error -= (1 - options.split_factor) * errors[static_cast<std::size_t>(leaf)];
  }
  for (std::size_t g = 0; g < candidates.merges.size(); ++g) {
    if (!chosen[static_cast<std::size_t>(candidates.merge_variable(g))]) continue;
    plan.edit.merge.push_back(candidates.merges[g]);
    for (const int leaf : candidates.siblings[g])
      plan.predicted_error += (options.merge_factor - 1) * errors[static_cast<std::size_t>(leaf)];
  }
  return plan;
}

}  // namespace tomofield::fit
