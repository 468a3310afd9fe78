#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace tomofield::bench {

/// One thing to measure: a call and the work that it does.
struct Case {
  std::string name;
  std::function<void()> run;
  double updates = 0;  ///< nominal voxel·view updates, for projections
  double done = 0;     ///< of those, the ones that a detector pixel makes
  double flops = 0;
  double bytes = 0;  ///< that pass between the core and its caches
};

/// Seconds a call on one SIMD target, one of each round.
struct Timing {
  std::int64_t target = 0;
  std::size_t which = 0;  ///< index into the cases
  std::vector<double> seconds;
  double median() const;
  double minimum() const;
};

/// Runs all cases on all targets in turn, `rounds` times, each for at least a
/// few milliseconds a round.
std::vector<Timing> measure(const std::vector<Case>& cases,
                            const std::vector<std::int64_t>& targets, int rounds);

}  // namespace tomofield::bench
