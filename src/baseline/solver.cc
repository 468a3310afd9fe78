#include "baseline/solver.h"

namespace tomofield::baseline {

std::optional<double> last_decrease(const Solution& solution) {
  const std::vector<double>& objective = solution.objective;
  if (objective.size() < 2) return std::nullopt;
  const double before = objective[(objective.size() - 1) * 9 / 10];
  return (before - objective.back()) / objective.back();
}

}  // namespace tomofield::baseline
