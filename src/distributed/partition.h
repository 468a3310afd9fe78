#pragma once

#include <span>

namespace tomofield::distributed {

/// The consecutive integers [begin, end).
struct Range {
  int begin = 0, end = 0;
  int size() const { return end - begin; }
  bool contains(int i) const { return begin <= i && i < end; }
  bool operator==(const Range&) const = default;
};

/// Returns part `index` of `count` parts of consecutive pieces, where `work` holds the cost of each
/// piece. Every part has at least one piece, and begins where the work before it is nearest to
/// index / count of the total. There must be at least `count` pieces.
Range part_of(std::span<const double> work, int index, int count);

}  // namespace tomofield::distributed
