#pragma once

#include <vector>

namespace tomofield::fit {

/// Yes-or-no decisions: minimise Σ cost_j x_j over x ∈ {0, 1}ⁿ where every row
/// Σ coefficient · x <= bound holds.
struct IntegerProgram {
  struct Term {
    int variable;
    double coefficient;
  };
  struct Row {
    std::vector<Term> terms;
    double bound;
  };
  std::vector<double> costs;
  std::vector<Row> rows;
};

/// An optimal solution, the same one on every run (COIN-OR CBC; nothing is
/// printed). x = 0 must be feasible or some other point be: a program without a
/// solution is an error of the caller's.
std::vector<bool> solve(const IntegerProgram& program);

}  // namespace tomofield::fit
