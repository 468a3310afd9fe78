#include "evaluate/face_jump.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/threads/parallel.h"

namespace tomofield::evaluate {
namespace {

// Pairs this near a face are compared with those across it.
constexpr std::int64_t kNearVoxels = 8;

// A leaf along one axis, in voxels of a region that has `size` of them.
struct Extent {
  std::int64_t begin, end, size;

  // Says where the pair of voxels i and i + 1 lies, both of which are in the leaf.
  PairPlace pair_inside(std::int64_t i) const {
    const bool follows_face = begin > 0 && i - begin < kNearVoxels;
    const bool precedes_face = end < size && end - 2 - i < kNearVoxels;
    return follows_face || precedes_face ? PairPlace::kNearFace : PairPlace::kElsewhere;
  }
};

// The means of pairs across faces and near them, along one axis or several.
struct Means {
  double across = 0.0, near = 0.0;  // sums over the pairs
  double num_across = 0.0, num_near = 0.0;

  Means operator+(const Means& other) const {
    return {across + other.across, near + other.near, num_across + other.num_across,
            num_near + other.num_near};
  }
  bool has_ratio() const { return num_across > 0.0 && near > 0.0; }
  double ratio() const { return (across / num_across) / (near / num_near); }
};

// Adds the jumps of pairs, summed over z, to those across faces and near them.
void divide(const std::vector<double>& jumps, const std::vector<PairPlace>& places, double& across,
            double& near) {
  for (std::size_t i = 0; i < jumps.size(); ++i) {
    if (places[i] == PairPlace::kAcrossFace) across += jumps[i];
    if (places[i] == PairPlace::kNearFace) near += jumps[i];
  }
}

// Returns Σ_z |from − to| at each x.
std::vector<double> jumps_between(const VoxelBlock& block, const float* from, const float* to,
                                  std::int64_t count) {
  std::vector<double> jumps(static_cast<std::size_t>(count));
  for (std::int64_t z = 0; z < block.shape.nz; ++z) {
    const std::int64_t section = z * block.section_stride;
    for (std::int64_t x = 0; x < count; ++x)
      jumps[static_cast<std::size_t>(x)] +=
          static_cast<double>(std::abs(to[section + x] - from[section + x]));
  }
  return jumps;
}

void count_pairs(const std::vector<PairPlace>& places, std::int64_t num_sections, Means& means) {
  const auto sections = static_cast<double>(num_sections);
  const auto number = [&](PairPlace place) {
    return sections * static_cast<double>(std::ranges::count(places, place));
  };
  means.num_across += number(PairPlace::kAcrossFace);
  means.num_near += number(PairPlace::kNearFace);
}

}  // namespace

RowJumps& RowJumps::operator+=(const RowJumps& other) {
  across_x += other.across_x;
  near_x += other.near_x;
  across_y += other.across_y;
  near_y += other.near_y;
  return *this;
}

std::vector<PairPlace> LeafFaces::pairs_along_x(std::int64_t row) const {
  const std::int64_t width = region_.width(), y = region_.y0 + row;
  std::vector<PairPlace> places(static_cast<std::size_t>(width - 1), PairPlace::kElsewhere);
  for (const int leaf : tree_.leaves_across(y, y + 1)) {
    const field::Square& square = tree_.leaf(leaf).square;
    const Extent along_x{square.x0 - region_.x0, square.x1() - region_.x0, width};
    if (0 < along_x.begin && along_x.begin < width)
      places[static_cast<std::size_t>(along_x.begin - 1)] = PairPlace::kAcrossFace;
    const std::int64_t end = std::min(along_x.end, width) - 1;
    for (std::int64_t x = std::max<std::int64_t>(along_x.begin, 0); x < end; ++x)
      places[static_cast<std::size_t>(x)] = along_x.pair_inside(x);
  }
  return places;
}

std::vector<PairPlace> LeafFaces::pairs_along_y(std::int64_t row) const {
  std::vector<PairPlace> places(static_cast<std::size_t>(region_.width()), PairPlace::kElsewhere);
  const std::int64_t next = region_.y0 + row + 1;
  for (const int leaf : tree_.leaves_across(next, next + 1)) {
    const field::Square& square = tree_.leaf(leaf).square;
    const Extent along_y{square.y0 - region_.y0, square.y1() - region_.y0, region_.height()};
    const PairPlace place = square.y0 == next ? PairPlace::kAcrossFace : along_y.pair_inside(row);
    const std::int64_t first = std::max<std::int64_t>(square.x0 - region_.x0, 0);
    const std::int64_t end = std::min(square.x1() - region_.x0, region_.width());
    for (std::int64_t x = first; x < end; ++x) places[static_cast<std::size_t>(x)] = place;
  }
  return places;
}

RowJumps row_jumps(const VoxelBlock& block, std::int64_t y, const LeafFaces& faces,
                   std::int64_t row) {
  RowJumps sums;
  const float* const here = block.row(y, 0);
  divide(jumps_between(block, here, here + 1, block.shape.nx - 1), faces.pairs_along_x(row),
         sums.across_x, sums.near_x);
  if (y + 1 < block.shape.ny)
    divide(jumps_between(block, here, block.row(y + 1, 0), block.shape.nx),
           faces.pairs_along_y(row), sums.across_y, sums.near_y);
  return sums;
}

std::optional<FaceJump> face_jump(std::span<const RowJumps> rows, const LeafFaces& faces,
                                  std::int64_t num_sections) {
  Means x, y;
  for (std::int64_t row = 0; row < std::ssize(rows); ++row) {
    const RowJumps& sums = rows[static_cast<std::size_t>(row)];
    x.across += sums.across_x;
    x.near += sums.near_x;
    y.across += sums.across_y;
    y.near += sums.near_y;
    count_pairs(faces.pairs_along_x(row), num_sections, x);
    if (row + 1 < std::ssize(rows)) count_pairs(faces.pairs_along_y(row), num_sections, y);
  }
  const Means both = x + y;
  if (!both.has_ratio()) return std::nullopt;
  FaceJump jump{.both = both.ratio(), .x = {}, .y = {}};
  if (x.has_ratio()) jump.x = x.ratio();
  if (y.has_ratio()) jump.y = y.ratio();
  return jump;
}

std::optional<FaceJump> face_jump(const base::Volume& volume, const LeafFaces& faces) {
  TOMOFIELD_CHECK(
      volume.shape.nx == faces.region().width() && volume.shape.ny == faces.region().height(),
      "a volume of the size of the region");
  std::vector<RowJumps> rows(static_cast<std::size_t>(volume.shape.ny));
  base::parallel_for("face jump", volume.shape.ny, [&](std::int64_t y) {
    rows[static_cast<std::size_t>(y)] = row_jumps(block_of(volume), y, faces, y);
  });
  return face_jump(rows, faces, volume.shape.nz);
}

}  // namespace tomofield::evaluate
