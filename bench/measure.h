#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace tomofield::bench {

/// Describes one thing to measure: a call and the work that it does.
struct Case {
  std::string name;
  std::function<void()> run;
  double updates = 0;  ///< projections: nominal voxel·view updates
  double done = 0;     ///< projections: updates that reach a detector pixel
  double flops = 0;
  double bytes = 0;  ///< traffic between the core and its caches
};

/// Holds the seconds of a call on one SIMD target, one value for each round.
struct Timing {
  std::int64_t target = 0;
  std::size_t which = 0;  ///< index into the cases
  std::vector<double> seconds;
  double median() const;
  double minimum() const;
};

/// Runs all cases on all targets in turn, `rounds` times, and returns their timings. A case runs
/// for at least a few milliseconds in each round.
std::vector<Timing> measure(const std::vector<Case>& cases,
                            const std::vector<std::int64_t>& targets, int rounds);

}  // namespace tomofield::bench
