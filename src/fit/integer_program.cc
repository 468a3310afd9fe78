#include "fit/integer_program.h"

#include <CbcModel.hpp>
#include <CoinPackedMatrix.hpp>
#include <OsiClpSolverInterface.hpp>
#include <cstddef>

#include "base/check.h"

namespace tomofield::fit {
namespace {

CoinPackedMatrix matrix_of(const IntegerProgram& program) {
  CoinPackedMatrix matrix(/*colordered=*/false, 0, 0);
  matrix.setDimensions(0, static_cast<int>(program.costs.size()));
  for (const IntegerProgram::Row& row : program.rows) {
    CoinPackedVector vector;
    for (const IntegerProgram::Term& term : row.terms)
      vector.insert(term.variable, term.coefficient);
    matrix.appendRow(vector);
  }
  return matrix;
}

}  // namespace

bool can_solve_integer_programs() { return true; }

std::vector<bool> solve(const IntegerProgram& program) {
  const std::size_t n = program.costs.size();
  std::vector<bool> solution(n);
  if (n == 0) return solution;
  const std::vector<double> lower(n, 0.0), upper(n, 1.0);
  std::vector<double> row_lower, row_upper;
  OsiClpSolverInterface relaxation;
  relaxation.messageHandler()->setLogLevel(0);
  for (const IntegerProgram::Row& row : program.rows) {
    row_lower.push_back(-relaxation.getInfinity());
    row_upper.push_back(row.bound);
  }
  relaxation.loadProblem(matrix_of(program), lower.data(), upper.data(), program.costs.data(),
                         row_lower.data(), row_upper.data());
  for (std::size_t j = 0; j < n; ++j) relaxation.setInteger(static_cast<int>(j));
  CbcModel model(relaxation);
  model.setLogLevel(0);
  model.solver()->messageHandler()->setLogLevel(0);
  model.branchAndBound();
  TOMOFIELD_CHECK(model.bestSolution() != nullptr, "the integer program has a solution");
  for (std::size_t j = 0; j < n; ++j) solution[j] = model.bestSolution()[j] > 0.5;
  return solution;
}

}  // namespace tomofield::fit
