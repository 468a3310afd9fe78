#pragma once

#include <vector>

namespace tomofield::fit {

/// Describes the problem to minimise Σ cost_j x_j over x ∈ {0, 1}ⁿ such that Σ coefficient · x <=
/// bound holds in every row.
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

/// Returns false in a build without COIN-OR CBC (TOMOFIELD_WITH_CBC=OFF), where solve() must not be
/// called.
bool can_solve_integer_programs();

/// Returns an optimal solution, the same one on every run. COIN-OR CBC finds it and prints nothing.
/// The program must have a feasible point, such as x = 0.
std::vector<bool> solve(const IntegerProgram& program);

}  // namespace tomofield::fit
