#include "evaluate/face_jump.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/parallel.h"

namespace tomofield::evaluate {
namespace {

// The mean of pairs across faces and inside leaves, along one axis or several.
struct Means {
  double across = 0.0, inside = 0.0;  // sums over the pairs
  double num_across = 0.0, num_inside = 0.0;

  Means operator+(const Means& other) const {
    return {across + other.across, inside + other.inside, num_across + other.num_across,
            num_inside + other.num_inside};
  }
  bool has_ratio() const { return num_across > 0.0 && inside > 0.0; }
  double ratio() const { return (across / num_across) / (inside / num_inside); }
};

// Adds the jumps from voxels to the next ones, summed over z, to those across faces or inside.
void divide(const std::vector<double>& jumps, const std::vector<char>& is_face, double& across,
            double& inside) {
  for (std::size_t x = 0; x < jumps.size(); ++x) (is_face[x] ? across : inside) += jumps[x];
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

void count_pairs(const std::vector<char>& is_face, std::int64_t num_sections, Means& means) {
  const auto faces = static_cast<double>(std::ranges::count(is_face, char{1}));
  const auto sections = static_cast<double>(num_sections);
  means.num_across += faces * sections;
  means.num_inside += (static_cast<double>(is_face.size()) - faces) * sections;
}

}  // namespace

RowJumps& RowJumps::operator+=(const RowJumps& other) {
  across_x += other.across_x;
  inside_x += other.inside_x;
  across_y += other.across_y;
  inside_y += other.inside_y;
  return *this;
}

std::vector<char> LeafFaces::after_voxels(std::int64_t row) const {
  std::vector<char> is_face(static_cast<std::size_t>(region_.width() - 1));
  const std::int64_t y = region_.y0 + row;
  for (const int leaf : tree_.leaves_across(y, y + 1)) {
    const std::int64_t x = tree_.leaf(leaf).square.x0 - region_.x0;
    if (0 < x && x < region_.width()) is_face[static_cast<std::size_t>(x - 1)] = 1;
  }
  return is_face;
}

std::vector<char> LeafFaces::after_row(std::int64_t row) const {
  std::vector<char> is_face(static_cast<std::size_t>(region_.width()));
  const std::int64_t next = region_.y0 + row + 1;
  for (const int leaf : tree_.leaves_across(next, next + 1)) {
    const field::Square& square = tree_.leaf(leaf).square;
    if (square.y0 != next) continue;
    const std::int64_t first = std::max<std::int64_t>(square.x0 - region_.x0, 0);
    const std::int64_t end = std::min(square.x1() - region_.x0, region_.width());
    for (std::int64_t x = first; x < end; ++x) is_face[static_cast<std::size_t>(x)] = 1;
  }
  return is_face;
}

RowJumps row_jumps(const VoxelBlock& block, std::int64_t y, const LeafFaces& faces,
                   std::int64_t row) {
  RowJumps sums;
  const float* const here = block.row(y, 0);
  divide(jumps_between(block, here, here + 1, block.shape.nx - 1), faces.after_voxels(row),
         sums.across_x, sums.inside_x);
  if (y + 1 < block.shape.ny)
    divide(jumps_between(block, here, block.row(y + 1, 0), block.shape.nx), faces.after_row(row),
           sums.across_y, sums.inside_y);
  return sums;
}

std::optional<FaceJump> face_jump(std::span<const RowJumps> rows, const LeafFaces& faces,
                                  std::int64_t num_sections) {
  Means x, y;
  for (std::int64_t row = 0; row < std::ssize(rows); ++row) {
    const RowJumps& sums = rows[static_cast<std::size_t>(row)];
    x.across += sums.across_x;
    x.inside += sums.inside_x;
    y.across += sums.across_y;
    y.inside += sums.inside_y;
    count_pairs(faces.after_voxels(row), num_sections, x);
    if (row + 1 < std::ssize(rows)) count_pairs(faces.after_row(row), num_sections, y);
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
