#include "evaluate/profile.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

// The two voxels of an axis between which a position lies, and the weight of the second.
struct Neighbours {
  std::int64_t low, high;
  double share;
  Neighbours(double position, std::int64_t n) {
    const double centre = std::clamp(position - 0.5, 0.0, static_cast<double>(n - 1));
    low = static_cast<std::int64_t>(centre);
    high = std::min(low + 1, n - 1);
    share = centre - static_cast<double>(low);
  }
};

double trilinear(const base::Volume& volume, const std::array<double, 3>& point) {
  const Neighbours x(point[0], volume.shape.nx), y(point[1], volume.shape.ny),
      z(point[2], volume.shape.nz);
  const auto along_x = [&](std::int64_t iy, std::int64_t iz) {
    return std::lerp(static_cast<double>(volume.at(x.low, iy, iz)),
                     static_cast<double>(volume.at(x.high, iy, iz)), x.share);
  };
  const auto along_y = [&](std::int64_t iz) {
    return std::lerp(along_x(y.low, iz), along_x(y.high, iz), y.share);
  };
  return std::lerp(along_y(z.low), along_y(z.high), z.share);
}

}  // namespace

void require_line_within(const LineSegment& line, const base::Box& voxels) {
  for (const auto& end : {line.from, line.to}) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (end[axis] >= static_cast<double>(voxels.begin[axis]) &&
          end[axis] <= static_cast<double>(voxels.end[axis]))
        continue;
      throw Error(fmt::format("the profile's end {:g},{:g},{:g} lies outside of the voxels {}",
                              end[0], end[1], end[2], to_text(voxels)));
    }
  }
  if (line.length() < 1.0)
    throw Error(
        fmt::format("the profile is {:g} voxels long: it needs at least one", line.length()));
}

double LineSegment::length() const {
  return std::hypot(to[0] - from[0], to[1] - from[1], to[2] - from[2]);
}

std::vector<std::array<double, 3>> LineSegment::points() const {
  std::vector<std::array<double, 3>> all;
  // Rounding must not cost a line of whole voxels its last point.
  const auto steps = static_cast<std::int64_t>(length() + 1e-9);
  for (std::int64_t step = 0; step <= steps; ++step) {
    const double part = std::min(1.0, static_cast<double>(step) / length());
    auto& point = all.emplace_back();
    for (std::size_t axis = 0; axis < 3; ++axis)
      point[axis] = from[axis] + part * (to[axis] - from[axis]);
  }
  return all;
}

std::vector<double> line_profile(const base::Volume& volume, const base::Box& place,
                                 const LineSegment& line) {
  require_line_within(line, place);
  std::vector<double> values;
  for (auto point : line.points()) {
    for (std::size_t axis = 0; axis < 3; ++axis)
      point[axis] -= static_cast<double>(place.begin[axis]);
    values.push_back(trilinear(volume, point));
  }
  return values;
}

std::string profile_csv(const LineSegment& line, double voxel_size_A,
                        const std::vector<ProfileColumn>& columns) {
  std::string text = "distance_A,x,y,z";
  for (const ProfileColumn& column : columns) text += "," + column.name;
  text += "\n";
  const auto points = line.points();
  for (std::size_t i = 0; i < points.size(); ++i) {
    text += fmt::format("{:.6g},{:.6g},{:.6g},{:.6g}", static_cast<double>(i) * voxel_size_A,
                        points[i][0], points[i][1], points[i][2]);
    for (const ProfileColumn& column : columns) text += fmt::format(",{:.8g}", column.values[i]);
    text += "\n";
  }
  return text;
}

}  // namespace tomofield::evaluate
