#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "distributed/communicator.h"

namespace tomofield::distributed {

/// Long arrays of which each process has a part, one after another in order of ranks, for the
/// first process to read in order and without ever having the whole: to write them to a file.
///
///   GatheredArrays arrays(processes, first, end);   // of each array, what this process has
///   const std::size_t a = arrays.add(values);       // all of it, of which [first, end) is true
///   arrays.read_on_first([&] { …arrays.hand_out(a, sink)… });
class GatheredArrays {
 public:
  GatheredArrays(const Communicator& processes, std::size_t first, std::size_t end);

  /// `values` are indexed as in the whole array. They must stay until read_on_first() has ended.
  std::size_t add(std::span<const float> values);

  /// Runs `body` on the first process while the others answer it. What it throws (Error) all throw.
  void read_on_first(const std::function<void()>& body) const;

  /// Inside that: one of the arrays, piece by piece.
  using Sink = std::function<void(std::span<const float>)>;
  void hand_out(std::size_t array, const Sink& sink) const;

 private:
  void answer() const;

  const Communicator& processes_;
  std::vector<std::size_t> limits_;  // process r has [limits_[r], limits_[r + 1])
  std::vector<std::span<const float>> arrays_;
};

}  // namespace tomofield::distributed
