// An MRC volume in memory as a volume that planes can be taken from.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/system/memory.h"
#include "base/threads/parallel.h"
#include "io/images/mrc.h"
#include "io/images/mrc_format.h"
#include "report/reduced_volume.h"
#include "tomofield/error.h"
#include "view/viewed_volume.h"

namespace tomofield::view {
namespace {

bool is_along_axes(const Point& direction) { return std::ranges::count(direction, 0.0) == 2; }

class ViewedMrc : public ViewedVolume {
 public:
  explicit ViewedMrc(const std::filesystem::path& path) {
    const io::MrcReader file(path);
    const io::MrcHeader& header = file.header();
    title_ = path.filename().string();
    size_ = {header.nx, header.ny, header.nz};
    voxel_size_A_ = io::cubic_voxel_size_A(header, path);
    io::warn_of_mode(header, path.string());
    contrast_ = report::contrast_of(file);
    held_ = report::reduced_size(header, most_voxels());
    if (held_ != size_) {
      note_ = fmt::format(
          "reduced to {} × {} × {} voxels, because the whole volume does not fit "
          "into half of the free memory",
          held_[0], held_[1], held_[2]);
    }
    read(file);
  }

 private:
  // Returns how many voxels fit into half of the memory that is free.
  static std::int64_t most_voxels() {
    constexpr std::size_t kUnknown = std::size_t{4} << 30;
    const std::size_t free = base::available_memory();
    return static_cast<std::int64_t>((free > 0 ? free : kUnknown) / 2 / sizeof(float));
  }

  void read(const io::MrcReader& file) {
    const auto area = static_cast<std::size_t>(held_[0] * held_[1]);
    voxels_.resize(area * static_cast<std::size_t>(held_[2]));
    report::reduce_volume(file, held_, [&](std::int64_t section, std::span<const float> values) {
      std::ranges::copy(values, voxels_.begin() + static_cast<std::ptrdiff_t>(area) * section);
    });
  }

  Point scale() const {  // voxels in memory of a voxel of the file
    Point of_axis;
    for (std::size_t axis = 0; axis < 3; ++axis)
      of_axis[axis] = static_cast<double>(held_[axis]) / static_cast<double>(size_[axis]);
    return of_axis;
  }

  int points_along_side(const Plane& plane) const {
    constexpr double kMostPoints = 8;
    return static_cast<int>(
        std::clamp(std::ceil(plane.step * scale()[0] - 1e-9), 1.0, kMostPoints));
  }
  std::int64_t points_per_pixel(const Plane& plane) const override {
    return std::int64_t{points_along_side(plane)} * points_along_side(plane);
  }

  // A pixel that is smaller than a voxel has the voxel's value in a plane along the axes, so that
  // voxels can be seen, and is interpolated in other planes. A larger one is a mean.
  std::vector<float> sample_voxels(const Plane& plane) const override {
    const Point scale = this->scale();
    const int points = points_along_side(plane);
    const bool is_turned = !is_along_axes(plane.right) || !is_along_axes(plane.up);
    std::vector<float> values(static_cast<std::size_t>(plane.width * plane.height));
    base::parallel_for("view plane", plane.height, [&](std::int64_t row) {
      for (std::int64_t column = 0; column < plane.width; ++column) {
        double sum = 0;
        for (int point = 0; point < points * points; ++point) {
          Point at = plane.position(static_cast<double>(column) + (point % points + 0.5) / points,
                                    static_cast<double>(row) + (point / points + 0.5) / points);
          for (std::size_t axis = 0; axis < 3; ++axis) at[axis] *= scale[axis];
          sum += is_turned ? interpolated(at) : nearest(at);
        }
        values[static_cast<std::size_t>(row * plane.width + column)] =
            static_cast<float>(sum / (points * points));
      }
    });
    return values;
  }

  // Return the value at a point. Beyond the faces it is that of the face.
  double nearest(const Point& at) const {
    return voxel({std::floor(at[0]), std::floor(at[1]), std::floor(at[2])});
  }
  double interpolated(const Point& at) const {
    Point low, part;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::floor(at[axis] - 0.5);
      part[axis] = at[axis] - 0.5 - low[axis];
    }
    double sum = 0;
    for (int corner = 0; corner < 8; ++corner) {
      Point of_corner = low;
      double weight = 1;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const bool is_high = (corner >> axis & 1) != 0;
        if (is_high) of_corner[axis] += 1;
        weight *= is_high ? part[axis] : 1 - part[axis];
      }
      sum += weight * voxel(of_corner);
    }
    return sum;
  }
  double voxel(const Point& index) const {
    std::int64_t at = 0;
    for (std::size_t axis = 3; axis-- > 0;) {
      const double last = static_cast<double>(held_[axis] - 1);
      at = at * held_[axis] + static_cast<std::int64_t>(std::clamp(index[axis], 0.0, last));
    }
    return static_cast<double>(voxels_[static_cast<std::size_t>(at)]);
  }

  std::array<std::int64_t, 3> held_{};  // voxels in memory
  std::vector<float> voxels_;           // [z, y, x]
};

}  // namespace

std::unique_ptr<ViewedVolume> open_mrc(const std::filesystem::path& path) {
  return std::make_unique<ViewedMrc>(path);
}

}  // namespace tomofield::view
