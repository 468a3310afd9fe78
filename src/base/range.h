#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

namespace tomofield::base {

/// The consecutive integers [begin, end). A range whose end is not above its begin is empty.
struct Range {
  int begin = 0, end = 0;

  int size() const { return end - begin; }
  bool is_empty() const { return end <= begin; }
  bool contains(int i) const { return begin <= i && i < end; }
  /// Returns true if this range contains all of `other`, which is not empty.
  bool contains(Range other) const { return begin <= other.begin && other.end <= end; }
  /// Returns true if this range and `other`, which is not empty, have an integer in common.
  bool overlaps(Range other) const { return !is_empty() && other.begin < end && begin < other.end; }
  /// Returns the integers that are in both ranges.
  Range common_with(Range other) const {
    const Range common{std::max(begin, other.begin), std::min(end, other.end)};
    return common.is_empty() ? Range{} : common;
  }
  /// Returns the smallest range that contains both.
  Range joined_with(Range other) const {
    if (is_empty()) return other;
    if (other.is_empty()) return *this;
    return {std::min(begin, other.begin), std::max(end, other.end)};
  }
  bool operator==(const Range&) const = default;
};

/// Returns consecutive ranges of similar sizes near `size` that cover [0, count).
inline std::vector<Range> parts_of(int count, int size) {
  const int num_parts = std::max(1, (count + size / 2) / size);
  const auto begin_of = [&](int part) {
    return static_cast<int>(static_cast<std::int64_t>(count) * part / num_parts);
  };
  std::vector<Range> parts;
  for (int part = 0; part < num_parts; ++part)
    parts.push_back({begin_of(part), begin_of(part + 1)});
  return parts;
}

/// Returns part `index` of `count` parts of consecutive pieces, where `work` holds the cost of each
/// piece. Every part has at least one piece, and begins where the work before it is nearest to
/// index / count of the total. There must be at least `count` pieces.
Range part_of(std::span<const double> work, int index, int count);

}  // namespace tomofield::base
