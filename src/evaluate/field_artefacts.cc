#include "evaluate/field_artefacts.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include "base/threads/parallel.h"
#include "base/trace.h"
#include "evaluate/speckle.h"
#include "field/sampling/aligned_rows.h"
#include "field/sampling/sample_box.h"
#include "kernels/lanes.h"

namespace tomofield::evaluate {
namespace {

using kernels::kLanes;

// The voxels that a thread decodes at once, without those around them.
constexpr std::int64_t kPartVoxels = std::int64_t{1} << 22;

// Sums of the densities of some voxels and of their squares.
struct Moments {
  double sum = 0.0, squares = 0.0;

  Moments& operator+=(const Moments& other) {
    sum += other.sum;
    squares += other.squares;
    return *this;
  }
};

// Returns the sums over each section, added in order of the slabs.
std::vector<Moments> section_moments(const field::Field& field, const field::OrientedBox& box,
                                     base::Range rows, const distributed::Communicator& processes) {
  const std::int64_t num_sections = box.size[2];
  const std::int64_t num_slabs = (box.size[1] + kLanes - 1) / kLanes;
  std::vector<Moments> all(static_cast<std::size_t>(num_slabs * num_sections));
  field::sample_box(field, box, rows, [&](const field::BoxPart& part) {
    const std::int64_t size = part.num_rows * box.size[0];
    for (std::int64_t s = 0; s < part.num_sections; ++s) {
      Moments sums;
      for (const float value : part.values.subspan(static_cast<std::size_t>(s * size),
                                                   static_cast<std::size_t>(size))) {
        const auto density = static_cast<double>(value);
        sums += {density, density * density};
      }
      all[static_cast<std::size_t>(part.first_row / kLanes * num_sections + part.first_section +
                                   s)] = sums;
    }
  });
  processes.allreduce_sum(std::span(all), &Moments::sum, &Moments::squares);
  std::vector<Moments> sections(static_cast<std::size_t>(num_sections));
  for (std::size_t i = 0; i < all.size(); ++i) sections[i % sections.size()] += all[i];
  return sections;
}

double deviation_of(const Moments& sums, double count) {
  const double mean = sums.sum / count;
  return std::sqrt(std::max(sums.squares / count - mean * mean, 0.0));
}

// Counts the speckles and sums up the jumps of the slabs of a region. Thread-safe.
class SlabScan {
 public:
  SlabScan(const field::Field& field, const field::OrientedBox& box, const LeafFaces& faces,
           double deviation)
      : decoder_(field, box), size_(box.size), faces_(faces), deviation_(deviation) {}

  // Adds the jumps of rows [first_row, first_row + rows.size()) to `rows` and returns the number of
  // speckles in them.
  std::int64_t scan(std::int64_t first_row, std::span<RowJumps> rows) const {
    const std::int64_t nx = size_[0], nz = size_[2];
    const std::int64_t above = std::min<std::int64_t>(first_row, 1);
    const std::int64_t begin = first_row - above;
    const std::int64_t end = std::min(first_row + std::ssize(rows) + 1, size_[1]);
    const auto leaves = decoder_.contract(begin, end - begin);
    const std::int64_t part = std::max<std::int64_t>(kPartVoxels / (kLanes * nx), 1);
    std::int64_t speckles = 0;
    std::vector<float> voxels;
    for (std::int64_t first = 0; first < nz; first += part) {
      const std::int64_t count = std::min(part, nz - first);
      // The sections before and after the part are neighbours of its own.
      const std::int64_t low = std::max<std::int64_t>(first - 1, 0);
      const base::Shape3 shape{nx, end - begin, std::min(first + count + 1, nz) - low};
      voxels.assign(shape.voxels(), 0.0f);
      decoder_.decode(leaves, low, shape.nz, shape.ny, voxels.data());
      const VoxelBlock block{voxels.data(), shape, nx, nx * shape.ny};
      speckles += count_speckles(block, deviation_);
      const VoxelBlock own = block.sections(first - low, count);
      for (std::int64_t r = 0; r < std::ssize(rows); ++r)
        rows[static_cast<std::size_t>(r)] += row_jumps(own, above + r, faces_, first_row + r);
    }
    return speckles;
  }

 private:
  field::AlignedRows decoder_;
  std::array<std::int64_t, 3> size_;
  const LeafFaces& faces_;
  double deviation_;
};

void add_speckle_and_faces(const field::Field& field, const field::OrientedBox& box,
                           const Rectangle& region, base::Range own,
                           const distributed::Communicator& processes, FieldArtefacts& found) {
  const LeafFaces faces(field.tree(), region);
  const SlabScan slabs(field, box, faces, found.deviation);
  std::vector<RowJumps> rows(static_cast<std::size_t>(box.size[1]));
  std::vector<std::int64_t> speckles((rows.size() + kLanes - 1) / kLanes);
  base::parallel_for("find artefacts", (own.size() + kLanes - 1) / kLanes, [&](std::int64_t s) {
    const std::int64_t first = own.begin + s * kLanes;
    const std::int64_t count = std::min<std::int64_t>(kLanes, own.end - first);
    speckles[static_cast<std::size_t>(first / kLanes)] = slabs.scan(
        first,
        std::span(rows).subspan(static_cast<std::size_t>(first), static_cast<std::size_t>(count)));
  });
  processes.allreduce_sum(std::span(speckles));
  processes.allreduce_sum(std::span(rows), &RowJumps::across_x, &RowJumps::near_x,
                          &RowJumps::across_y, &RowJumps::near_y);
  const std::int64_t inner = num_inner_voxels({box.size[0], box.size[1], box.size[2]});
  const auto all = std::accumulate(speckles.begin(), speckles.end(), std::int64_t{0});
  if (inner > 0) found.speckle = static_cast<double>(all) / static_cast<double>(inner);
  found.faces = face_jump(rows, faces, box.size[2]);
}

}  // namespace

FieldArtefacts find_artefacts(const field::Field& field, const Rectangle& region, base::Range rows,
                              const distributed::Communicator& processes) {
  const base::TraceSpan span("find artefacts");
  const field::OrientedBox box = field::box_between(
      {static_cast<double>(region.x0), static_cast<double>(region.y0), 0.0},
      {static_cast<double>(region.x1), static_cast<double>(region.y1), field.thickness()}, 1.0);
  FieldArtefacts found;
  const auto size = static_cast<double>(box.size[0] * box.size[1]);
  Moments whole;
  for (const Moments& section : section_moments(field, box, rows, processes)) {
    found.section_mean.push_back(section.sum / size);
    found.section_deviation.push_back(deviation_of(section, size));
    whole += section;
  }
  const double count = size * static_cast<double>(box.size[2]);
  found.deviation = deviation_of(whole, count);
  add_speckle_and_faces(field, box, region, rows, processes, found);
  return found;
}

}  // namespace tomofield::evaluate
