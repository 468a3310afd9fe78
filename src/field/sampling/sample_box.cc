#include "field/sampling/sample_box.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/check.h"
#include "base/plausible.h"
#include "base/progress.h"
#include "base/system/memory.h"
#include "base/threads/parallel.h"
#include "field/sampling/aligned_rows.h"
#include "tomofield/error.h"

namespace tomofield::field {
namespace {

constexpr std::int64_t kPartValues = std::int64_t{1} << 22;
constexpr std::int64_t kBlock = 16;  // rows of a turned box

// Returns zeros. The system takes seconds to give memory for many, in which the caller may stop.
std::vector<float> zeros(std::size_t count) {
  std::vector<float> values;
  values.reserve(count);
  while (values.size() < count) {
    base::allow_interruption();
    values.resize(std::min(count, values.size() + static_cast<std::size_t>(kPartValues)));
  }
  return values;
}

// Returns the number of sections of an aligned box whose rows are sampled at once.
std::int64_t sections_at_once(const OrientedBox& box, std::int64_t num_rows) {
  return std::clamp(kPartValues / (num_rows * box.size[0]), std::int64_t{1}, box.size[2]);
}

// Returns the bytes of the parts that are sampled at once, with two copies of who writes them, or 0
// for usual ones, which are small.
std::size_t bytes_of_parts(const OrientedBox& box, base::Range some) {
  constexpr std::int64_t kCopies = 3, kUsual = 2 * kPartValues;
  const std::int64_t rows = std::min<std::int64_t>(kBlock, some.size());
  const std::int64_t values =
      rows * box.size[0] * (box.is_aligned() ? sections_at_once(box, rows) : 1);
  if (values <= kUsual) return 0;
  const std::int64_t parts = (some.size() + rows - 1) / rows * (box.is_aligned() ? 1 : box.size[2]);
  const std::int64_t at_once = std::min<std::int64_t>(base::thread_count(), parts);
  return static_cast<std::size_t>(at_once * values * kCopies) * sizeof(float);
}

void require_memory_of_parts(const OrientedBox& box, base::Range some) {
  const std::size_t bytes = bytes_of_parts(box, some);
  if (bytes == 0) return;
  base::require_memory(bytes, fmt::format("sampling rows of {} voxels", box.size[0]).c_str(),
                       "use fewer threads, or a box that is shorter along x");
}

// Samples a box along the axes: some rows of all sections, then the next rows.
void sample_aligned(const Field& field, const OrientedBox& box, base::Range some,
                    const BoxSink& sink) {
  const AlignedRows rows(field, box);
  const auto [nx, ny, nz] = box.size;
  const std::int64_t block = rows.rows_at_once();
  const std::int64_t part = sections_at_once(box, block);
  TOMOFIELD_CHECK(some.begin % block == 0 && some.end <= ny, "rows in whole blocks");
  const std::int64_t num_blocks = (some.end - some.begin + block - 1) / block;
  base::parallel_for("sample box", num_blocks, [&, nx = nx, nz = nz](std::int64_t index) {
    const std::int64_t first_row = some.begin + index * block;
    const std::int64_t num_rows = std::min(block, some.end - first_row);
    const auto leaves = rows.contract(first_row, num_rows);
    std::vector<float> values;
    for (std::int64_t first = 0; first < nz; first += part) {
      const std::int64_t count = std::min(part, nz - first);
      values.assign(static_cast<std::size_t>(count * num_rows * nx), 0.0f);
      base::allow_interruption();
      rows.decode(leaves, first, count, num_rows, values.data());
      sink({first, count, first_row, num_rows, values});
    }
  });
}

// Says of the voxels of a box whether they lie beside a field.
class BesideField {
 public:
  BesideField(const Field& field, const OrientedBox& box)
      : box_(box), reach_px_(std::numbers::sqrt3 / 2 * box.voxel_px) {
    const RootGrid& roots = field.tree().roots();
    low_ = {static_cast<double>(roots.x0), static_cast<double>(roots.y0), 0.0};
    const auto side = static_cast<double>(roots.cell_size);
    high_ = {low_[0] + roots.columns * side, low_[1] + roots.rows * side, field.thickness()};
    // The domain begins with a root cell's first pixel, and faces lie on centres of pixels.
    for (const std::size_t a : {0, 1}) high_[a] += kPixelCentre;
  }
  bool operator()(std::int64_t x, std::int64_t y, std::int64_t z) const {
    const Point middle = box_.position(
        {static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5, static_cast<double>(z) + 0.5});
    for (std::size_t a = 0; a < 3; ++a)
      if (middle[a] < low_[a] - reach_px_ || middle[a] > high_[a] + reach_px_) return true;
    return false;
  }

 private:
  const OrientedBox& box_;
  double reach_px_;  // from the middle of a voxel to its corners
  Point low_{}, high_{};
};

// Returns the mean density of a voxel's points.
double voxel_density(const Field& field, const OrientedBox& box, std::int64_t x, std::int64_t y,
                     std::int64_t z) {
  constexpr std::int64_t kManyPoints = 16;  // along an axis: rows of such voxels take long
  const std::int64_t factor = points_per_voxel(box);
  const auto along = [factor](std::int64_t voxel, std::int64_t point) {
    return static_cast<double>(voxel) +
           (static_cast<double>(point) + 0.5) / static_cast<double>(factor);
  };
  double sum = 0.0;
  for (std::int64_t k = 0; k < factor; ++k) {
    if (factor >= kManyPoints) base::allow_interruption();
    for (std::int64_t j = 0; j < factor; ++j) {
      for (std::int64_t i = 0; i < factor; ++i) {
        const Point at = box.position({along(x, i), along(y, j), along(z, k)});
        sum += field.density(at[0], at[1], at[2]);
      }
    }
  }
  return sum / static_cast<double>(factor * factor * factor);
}

void sample_rotated(const Field& field, const OrientedBox& box, base::Range some,
                    const BoxSink& sink) {
  const auto [nx, ny, nz] = box.size;
  const std::int64_t blocks = (some.end - some.begin + kBlock - 1) / kBlock;
  const BesideField is_beside(field, box);
  base::parallel_for("sample rows", nz * blocks, [&, nx = nx](std::int64_t index) {
    const std::int64_t section = index / blocks;
    const std::int64_t first_row = some.begin + index % blocks * kBlock;
    const std::int64_t num_rows = std::min(kBlock, some.end - first_row);
    std::vector<float> values;
    values.reserve(static_cast<std::size_t>(num_rows * nx));
    for (std::int64_t row = first_row; row < first_row + num_rows; ++row) {
      base::allow_interruption();
      for (std::int64_t x = 0; x < nx; ++x)
        values.push_back(is_beside(x, row, section)
                             ? 0.0f
                             : static_cast<float>(voxel_density(field, box, x, row, section)));
    }
    sink({section, 1, first_row, num_rows, values});
  });
}

}  // namespace

Rotation rotation_from_euler(double rot_deg, double tilt_deg, double psi_deg) {
  constexpr double kDegree = std::numbers::pi / 180.0, kLargest_deg = 1e5;
  for (const double angle_deg : {rot_deg, tilt_deg, psi_deg})
    if (!base::is_plausible(angle_deg, kLargest_deg))
      throw Error(fmt::format("a box cannot be turned by {}°: give Euler angles from -{:g} to {:g}",
                              angle_deg, kLargest_deg, kLargest_deg));
  const double ca = std::cos(rot_deg * kDegree), sa = std::sin(rot_deg * kDegree);
  const double cb = std::cos(tilt_deg * kDegree), sb = std::sin(tilt_deg * kDegree);
  const double cg = std::cos(psi_deg * kDegree), sg = std::sin(psi_deg * kDegree);
  return {{{cg * cb * ca - sg * sa, cg * cb * sa + sg * ca, -cg * sb},
           {-sg * cb * ca - cg * sa, -sg * cb * sa + cg * ca, sg * sb},
           {sb * ca, sb * sa, cb}}};
}

Point OrientedBox::position(const Point& voxel) const {
  Point offset{};
  for (std::size_t a = 0; a < 3; ++a)
    offset[a] = (voxel[a] - static_cast<double>(size[a]) / 2) * voxel_px;
  Point at = centre_px;
  for (std::size_t a = 0; a < 3; ++a) {
    const auto& row = field_from_box[a];
    at[a] += row[0] * offset[0] + row[1] * offset[1] + row[2] * offset[2];
  }
  return at;
}

OrientedBox box_between(const Point& low, const Point& high, double voxel_px) {
  // Sizes that are whole but for rounding count as whole.
  constexpr double kRounding = 1e-6;
  OrientedBox box;
  box.voxel_px = voxel_px;
  for (std::size_t a = 0; a < 3; ++a) {
    box.centre_px[a] = (low[a] + high[a]) / 2;
    const double voxels = std::floor((high[a] - low[a]) / voxel_px + kRounding);
    if (!(voxels <= kMostVoxelsAlongAxis))
      throw Error(
          fmt::format("voxels of {:g} px are too small: there would be {:.2g} along an axis, and "
                      "at most {} are allowed",
                      voxel_px, voxels, kMostVoxelsAlongAxis));
    box.size[a] = std::max<std::int64_t>(1, static_cast<std::int64_t>(voxels));
  }
  return box;
}

double num_points(const OrientedBox& box) {
  double points = std::pow(std::max(1.0, std::ceil(box.voxel_px - 1e-9)), 3);
  for (const std::int64_t size : box.size) points *= static_cast<double>(size);
  return points;
}

void require_feasible(const OrientedBox& box) {
  constexpr double kMostPoints = 1e13;  // hours to days of a machine
  const double points = num_points(box);
  if (points <= kMostPoints && *std::ranges::max_element(box.size) <= kMostVoxelsAlongAxis) return;
  throw Error(fmt::format(
      "a box of {} × {} × {} voxels of {:g} px is too large: sampling it takes {:.2g} points, and "
      "at most {:.0g} are allowed, with at most {} voxels along an axis",
      box.size[0], box.size[1], box.size[2], box.voxel_px, points, kMostPoints,
      kMostVoxelsAlongAxis));
}

std::int64_t points_per_voxel(const OrientedBox& box) {
  return std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(box.voxel_px - 1e-9)));
}

void sample_box(const Field& field, const OrientedBox& box, const BoxSink& sink) {
  require_feasible(box);
  sample_box(field, box, {0, static_cast<int>(box.size[1])}, sink);
}

void sample_box(const Field& field, const OrientedBox& box, base::Range rows, const BoxSink& sink) {
  TOMOFIELD_CHECK(box.size[0] > 0 && box.size[1] > 0 && box.size[2] > 0 && box.voxel_px > 0,
                  fmt::format("a box of {} × {} × {} voxels of {} px", box.size[0], box.size[1],
                              box.size[2], box.voxel_px));
  require_memory_of_parts(box, rows);
  box.is_aligned() ? sample_aligned(field, box, rows, sink)
                   : sample_rotated(field, box, rows, sink);
}

std::vector<float> sample_box(const Field& field, const OrientedBox& box) {
  return gather_box(box, [&](const BoxSink& sink) { sample_box(field, box, sink); });
}

void require_memory_of(const OrientedBox& box) {
  require_feasible(box);
  const auto [nx, ny, nz] = box.size;
  const std::size_t of_parts = bytes_of_parts(box, {0, static_cast<int>(ny)});
  base::require_memory(static_cast<std::size_t>(nx * ny * nz) * sizeof(float) + of_parts,
                       fmt::format("a box of {} × {} × {} voxels", nx, ny, nz).c_str(),
                       "sample it in parts");
}

std::vector<float> gather_box(const OrientedBox& box, const BoxSource& source) {
  require_memory_of(box);
  const auto [nx, ny, nz] = box.size;
  std::vector<float> volume = zeros(static_cast<std::size_t>(nx * ny * nz));
  source([&, nx = nx, ny = ny](const BoxPart& part) {
    const auto rows = static_cast<std::ptrdiff_t>(part.num_rows * nx);
    for (std::int64_t s = 0; s < part.num_sections; ++s) {
      const std::int64_t at = ((part.first_section + s) * ny + part.first_row) * nx;
      std::copy_n(part.values.begin() + s * rows, rows, volume.begin() + at);
    }
  });
  return volume;
}

std::vector<float> sample_points(const Field& field, std::span<const Point> points) {
  std::vector<float> values = zeros(points.size());
  constexpr std::int64_t kBatch = 1024;
  const auto count = std::ssize(points);
  base::parallel_for("sample points", (count + kBatch - 1) / kBatch, [&](std::int64_t batch) {
    const std::int64_t end = std::min(count, (batch + 1) * kBatch);
    base::allow_interruption();
    for (auto i = static_cast<std::size_t>(batch * kBatch); i < static_cast<std::size_t>(end); ++i)
      values[i] = static_cast<float>(field.density(points[i][0], points[i][1], points[i][2]));
  });
  return values;
}

std::vector<float> middle_plane(const Field& field, const Rectangle& region) {
  OrientedBox box;
  box.size = {region.width(), region.height(), 1};
  box.centre_px = {0.5 * static_cast<double>(region.x0 + region.x1),
                   0.5 * static_cast<double>(region.y0 + region.y1), 0.5 * field.thickness()};
  return sample_box(field, box);
}

}  // namespace tomofield::field
