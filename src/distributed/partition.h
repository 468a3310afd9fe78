#pragma once

#include <span>

namespace tomofield::distributed {

/// Consecutive numbers [begin, end).
struct Range {
  int begin = 0, end = 0;
  int size() const { return end - begin; }
  bool contains(int i) const { return begin <= i && i < end; }
  bool operator==(const Range&) const = default;
};

/// Part `index` of `count` of consecutive pieces of work: every part gets at least one piece,
/// and starts where the work before it is nearest to its share. There must be as many pieces.
Range part_of(std::span<const double> work, int index, int count);

}  // namespace tomofield::distributed
