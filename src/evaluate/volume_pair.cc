#include "evaluate/volume_pair.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "base/log.h"
#include "io/images/mrc.h"
#include "io/images/mrc_format.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

std::string to_text(const VolumeSizes& sizes) {
  return fmt::format("{} × {} × {}", sizes[0], sizes[1], sizes[2]);
}

std::string quoted(const io::MrcReader& volume) {
  return fmt::format("'{}'", volume.path().string());
}

double common_voxel_size_A(const io::MrcReader& first, const io::MrcReader& second) {
  return evaluate::common_voxel_size_A(
      quoted(first), io::cubic_voxel_size_A(first.header(), first.path()), quoted(second),
      io::cubic_voxel_size_A(second.header(), second.path()));
}

// The voxel of `b` on which the first voxel of `a` lies.
using Offset = std::array<std::int64_t, 3>;

// Warns of a volume that has no place, because it was turned.
void warn_of_turned(const io::MrcReader& volume) {
  base::log_warning(fmt::format(
      "'{}' was turned before it was sampled, so its ORIGIN is not its place: it is laid on the "
      "middle of the other volume",
      volume.path().string()));
}

[[noreturn]] void throw_between_voxels(const io::MrcReader& a, const io::MrcReader& b,
                                       double voxels) {
  throw Error(
      fmt::format("'{}' begins {:.4g} voxels after '{}' (ORIGIN), which is no whole number: sample "
                  "both at the same places",
                  b.path().string(), voxels, a.path().string()));
}

// Returns the offset by the ORIGINs if they make one volume a part of the other.
// Otherwise they say nothing: many programs write other things there, and most nothing.
std::optional<Offset> offset_by_origin(const io::MrcReader& a, const io::MrcReader& b) {
  for (const io::MrcReader* volume : {&a, &b})
    if (is_turned(*volume)) return warn_of_turned(*volume), std::nullopt;
  const bool are_ours = place_A(a) && place_A(b);
  const VolumeSizes size_a = whole_box(a).end, size_b = whole_box(b).end;
  Offset offset{};
  bool lies_in_b = true, lies_in_a = true;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double voxel_A = b.header().voxel_size_A[axis];
    const double voxels =
        (a.header().origin_A[axis] - b.header().origin_A[axis]) / (voxel_A > 0 ? voxel_A : 1.0);
    if (!(std::abs(voxels) < 1e6)) return {};
    if (std::abs(voxels - std::round(voxels)) > 0.01) {
      if (are_ours) throw_between_voxels(a, b, -voxels);
      return {};
    }
    offset[axis] = std::llround(voxels);
    lies_in_b = lies_in_b && offset[axis] >= 0 && offset[axis] + size_a[axis] <= size_b[axis];
    lies_in_a = lies_in_a && offset[axis] <= 0 && offset[axis] + size_a[axis] >= size_b[axis];
  }
  if (are_ours && size_a != size_b && !lies_in_a && !lies_in_b &&
      !have_axes_in_another_order(size_a, size_b))
    throw Error(fmt::format(
        "'{}' and '{}' are of two regions of one volume, and neither is a part of the other: the "
        "latter begins {}, {}, {} voxels after the former (ORIGIN), so give volumes of one region",
        a.path().string(), b.path().string(), -offset[0], -offset[1], -offset[2]));
  if (are_ours && size_a == size_b && offset != Offset{})
    throw Error(fmt::format(
        "'{}' and '{}' are of two places of one volume: the latter begins {}, {}, {} voxels after "
        "the former (ORIGIN), so give volumes of one region",
        a.path().string(), b.path().string(), -offset[0], -offset[1], -offset[2]));
  if (size_a == size_b && offset != Offset{})
    base::log_info(fmt::format(
        "'{}' begins {}, {}, {} voxels after '{}' by their ORIGINs, of which one or both are of "
        "other programs: the volumes count as of one region",
        b.path().string(), -offset[0], -offset[1], -offset[2], a.path().string()));
  const bool says_something = offset != Offset{} || are_ours;
  if (!says_something || !(lies_in_a || lies_in_b)) return {};
  return offset;
}

Offset offset_by_centres(const io::MrcReader& a, const io::MrcReader& b) {
  const VolumeSizes size_a = whole_box(a).end, size_b = whole_box(b).end;
  Offset offset;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int64_t common = std::min(size_a[axis], size_b[axis]);
    offset[axis] = (size_b[axis] - common) / 2 - (size_a[axis] - common) / 2;
  }
  return offset;
}

// Returns the box that both volumes have, in voxels of `b`.
base::Box common_box(const io::MrcReader& a, const io::MrcReader& b, const Offset& offset) {
  const VolumeSizes size_a = whole_box(a).end, size_b = whole_box(b).end;
  base::Box common;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    common.begin[axis] = std::max<std::int64_t>(0, offset[axis]);
    common.end[axis] = std::min(size_b[axis], offset[axis] + size_a[axis]);
  }
  return common;
}

// Refuses sizes of which laying the volumes centre on centre makes no sense, and warns of different
// ones.
void check_sizes(const io::MrcReader& first, const io::MrcReader& second) {
  const VolumeSizes a = whole_box(first).end, b = whole_box(second).end;
  if (a == b) return;
  const auto mismatch = [&](const char* advice) {
    return Error(fmt::format("'{}' has {} voxels and '{}' {}: {}", first.path().string(),
                             to_text(a), second.path().string(), to_text(b), advice));
  };
  if (have_axes_in_another_order(a, b))
    throw mismatch("the axes are in another order; write both volumes with the same --axes");
  if (!share_half(a, b))
    throw mismatch(
        "less than half of one is in the other, and their ORIGINs do not say that one is a part "
        "of the other; are they of the same specimen and scale?");
  const bool have_places = first.header().origin_A != second.header().origin_A;
  base::log_warning(
      fmt::format("'{}' has {} voxels and '{}' {}: the common centred box is compared{}",
                  first.path().string(), to_text(a), second.path().string(), to_text(b),
                  have_places ? ", because their ORIGINs make none a part of the other" : ""));
}

void check_box(const base::Box& box, const base::Box& common, const io::MrcReader& second) {
  if (lies_within(box, common)) return;
  throw Error(fmt::format(
      "the box {} must not be empty and must lie within {}, what both volumes have, in voxels of "
      "'{}'",
      evaluate::to_text(box), evaluate::to_text(common), second.path().string()));
}

}  // namespace

bool voxel_sizes_differ(double first_A, double second_A, double tolerance) {
  return io::is_known_size(first_A) && io::is_known_size(second_A) &&
         std::abs(first_A - second_A) > tolerance * second_A;
}

double common_voxel_size_A(const std::string& first, double first_A, const std::string& second,
                           double second_A) {
  if (voxel_sizes_differ(first_A, second_A, kMaxScaleDifference))
    throw Error(fmt::format(
        "{} has voxels of {:.4g} Å and {} of {:.4g} Å: bring them to one voxel size first", first,
        first_A, second, second_A));
  const bool is_known = io::is_known_size(second_A) || !io::is_known_size(first_A);
  const double common_A = is_known ? second_A : first_A;
  if (std::abs(first_A - second_A) > 1e-4 * std::abs(second_A))
    base::log_warning(fmt::format(
        "the voxel sizes differ, {} has {:.6g} Å and {} {:.6g} Å: compared voxel by voxel all the "
        "same, with voxels of {:.6g} Å",
        first, first_A, second, second_A, common_A));
  return common_A;
}

bool is_turned(const io::MrcReader& volume) {
  return std::ranges::count(volume.header().labels, io::kLabelOfTurnedBox) > 0;
}

std::optional<std::array<double, 3>> place_A(const io::MrcReader& volume) {
  const bool is_ours = std::ranges::any_of(volume.header().labels, [](const std::string& label) {
    return label.starts_with("tomofield");
  });
  return is_ours && !is_turned(volume) ? std::optional(volume.header().origin_A) : std::nullopt;
}

bool lies_at(const std::array<double, 3>& place_A, const Rectangle& region, double pixel_size_A) {
  constexpr double kSamePlace_px = 0.5;
  const std::array<std::int64_t, 3> corner{region.x0, region.y0, 0};
  return std::ranges::equal(place_A, corner, [&](double at_A, std::int64_t at_px) {
    return std::fabs(at_A / pixel_size_A - static_cast<double>(at_px)) < kSamePlace_px;
  });
}

void require_whole(const std::filesystem::path& path) {
  const io::MrcReader volume(path);
  const auto place = place_A(volume);
  const std::array<double, 3>& origin_A = volume.header().origin_A;
  if (!place && !is_turned(volume) && origin_A != std::array{0.0, 0.0, 0.0})
    base::log_warning(fmt::format(
        "'{}' has an ORIGIN of {:.6g}, {:.6g}, {:.6g} Å by another program, and positions count "
        "from its first voxel",
        path.string(), origin_A[0], origin_A[1], origin_A[2]));
  if (!is_turned(volume) && (!place || *place == std::array{0.0, 0.0, 0.0})) return;
  throw Error(fmt::format("'{}' is {}, and the list has positions in the whole volume: give that",
                          path.string(),
                          is_turned(volume) ? "a turned box" : "a part of a volume (ORIGIN)"));
}

bool have_axes_in_another_order(const VolumeSizes& first, const VolumeSizes& second) {
  return first != second && std::ranges::is_permutation(first, second);
}

bool share_half(const VolumeSizes& first, const VolumeSizes& second) {
  return std::ranges::equal(first, second, [](std::int64_t a, std::int64_t b) {
    return 2 * std::min(a, b) >= std::max(a, b);
  });
}

VolumePair read_pair(const std::filesystem::path& first, const std::filesystem::path& second,
                     const std::optional<base::Box>& box) {
  const io::MrcReader a(first), b(second);
  const double voxel_A = common_voxel_size_A(a, b);
  const std::optional<Offset> part = offset_by_origin(a, b);
  const Offset offset = part.value_or(offset_by_centres(a, b));
  const base::Box common = common_box(a, b, offset);
  if (part) {
    if (whole_box(a).end != whole_box(b).end) {
      base::log_info(fmt::format("placed by their ORIGINs: what both have is {} of '{}'",
                                 evaluate::to_text(common), second.string()));
    }
  } else {
    check_sizes(a, b);
  }
  if (box) check_box(*box, common, b);
  const base::Box in_second = box.value_or(common);
  base::Box in_first = in_second;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    in_first.begin[axis] -= offset[axis];
    in_first.end[axis] -= offset[axis];
  }
  VolumePair pair{read_box(a, in_first), read_box(b, in_second), in_second};
  pair.first.voxel_size_A = pair.second.voxel_size_A = voxel_A;
  return pair;
}

}  // namespace tomofield::evaluate
