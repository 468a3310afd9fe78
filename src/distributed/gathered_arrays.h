#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "distributed/communicator.h"

namespace tomofield::distributed {

/// Gives the root access to long arrays that are distributed over the ranks, one consecutive
/// part a rank. The root reads them in order, piece by piece, without ever holding a whole
/// array, for example to write them to a file.
///
///   GatheredArrays arrays(processes, first, end);   // this rank owns [first, end) of each array
///   const std::size_t a = arrays.add(values);       // whole length; [first, end) is valid here
///   arrays.read_on_root([&] { …arrays.hand_out(a, sink)… });
class GatheredArrays {
 public:
  GatheredArrays(const Communicator& processes, std::size_t first, std::size_t end);

  /// Adds an array and returns its number. `values` has the length and indices of the whole array
  /// and must stay valid until read_on_root() has ended.
  std::size_t add(std::span<const float> values);

  /// Runs `body` on the root while the other ranks serve its reads. If it throws Error, all
  /// ranks throw SharedError.
  void read_on_root(const std::function<void()>& body) const;

  /// Hands array number `array` to `sink` in pieces, from the first element on. Only the `body` of
  /// read_on_root() may call it.
  using Sink = std::function<void(std::span<const float>)>;
  void hand_out(std::size_t array, const Sink& sink) const;

 private:
  void answer() const;

  const Communicator& processes_;
  std::vector<std::size_t> limits_;  // rank r owns [limits_[r], limits_[r + 1])
  std::vector<std::span<const float>> arrays_;
};

}  // namespace tomofield::distributed
