#include "evaluate/volume_pair.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "base/log.h"
#include "io/mrc.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

using Sizes = std::array<std::int64_t, 3>;

std::string to_text(const Sizes& sizes) {
  return fmt::format("{} × {} × {}", sizes[0], sizes[1], sizes[2]);
}

/// 0 and 1 Å are what programs write that do not know.
bool is_known(double voxel_size_A) { return voxel_size_A > 0.0 && voxel_size_A != 1.0; }

void check_voxel_sizes(const io::MrcReader& first, const io::MrcReader& second) {
  const double a = first.header().voxel_size_A[0], b = second.header().voxel_size_A[0];
  if (std::abs(a - b) <= 1e-4 * std::abs(b)) return;
  if (is_known(a) && is_known(b) && std::abs(a - b) > 0.05 * b)
    throw Error(fmt::format(
        "'{}' has voxels of {:.4g} Å and '{}' of {:.4g} Å: bring them to one voxel size first",
        first.path().string(), a, second.path().string(), b));
  base::log_warning(
      fmt::format("the voxel sizes differ ({:.6g} Å and {:.6g} Å): compared voxel by "
                  "voxel all the same",
                  a, b));
}

void check_sizes(const io::MrcReader& first, const io::MrcReader& second, const Sizes& common) {
  const Sizes a = whole_box(first).last, b = whole_box(second).last;
  if (a == b) return;
  Sizes sorted_a = a, sorted_b = b;
  std::sort(sorted_a.begin(), sorted_a.end());
  std::sort(sorted_b.begin(), sorted_b.end());
  const auto mismatch = [&](const char* advice) {
    return Error(fmt::format("'{}' has {} voxels and '{}' {}: {}", first.path().string(),
                             to_text(a), second.path().string(), to_text(b), advice));
  };
  if (sorted_a == sorted_b)
    throw mismatch("the axes are in another order; write both volumes with the same --axes");
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (2 * common[axis] < b[axis])
      throw mismatch(
          "less than half of the second is there; are they of the same specimen and scale?");
  }
  base::log_warning(
      fmt::format("'{}' has {} voxels and '{}' {}: the common centred box is compared",
                  first.path().string(), to_text(a), second.path().string(), to_text(b)));
}

void check_box(const Box& box, const Box& common, const io::MrcReader& second) {
  if (lies_within(box, common)) return;
  throw Error(fmt::format(
      "the box {} must not be empty and must lie within {}, what both volumes have, in voxels of "
      "'{}'",
      evaluate::to_text(box), evaluate::to_text(common), second.path().string()));
}

}  // namespace

VolumePair read_pair(const std::filesystem::path& first, const std::filesystem::path& second,
                     const std::optional<Box>& box) {
  const io::MrcReader a(first), b(second);
  const Sizes size_a = whole_box(a).last, size_b = whole_box(b).last;
  Sizes common_sizes;
  Box common;  // in voxels of the second
  for (std::size_t axis = 0; axis < 3; ++axis) {
    common_sizes[axis] = std::min(size_a[axis], size_b[axis]);
    common.first[axis] = (size_b[axis] - common_sizes[axis]) / 2;
    common.last[axis] = common.first[axis] + common_sizes[axis];
  }
  check_sizes(a, b, common_sizes);
  check_voxel_sizes(a, b);
  if (box) check_box(*box, common, b);
  const Box in_second = box.value_or(common);
  Box in_first = in_second;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int64_t shift = (size_a[axis] - common_sizes[axis]) / 2 - common.first[axis];
    in_first.first[axis] += shift;
    in_first.last[axis] += shift;
  }
  return {read_box(a, in_first), read_box(b, in_second), in_second};
}

}  // namespace tomofield::evaluate
