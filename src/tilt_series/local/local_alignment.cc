#include "tilt_series/local/local_alignment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

namespace tomofield::tilt_series {
namespace {

using geometry::ViewWarp;
using Vector = ViewWarp::Vector;

double to_radians(double degrees) { return degrees * std::numbers::pi / 180.0; }

// Returns q with place(q) = p, near p. Local alignments move neighbours nearly alike, so each step
// leaves a small part of the error.
Vector aligned_place(const LocalPlace& place, const Vector& p) {
  constexpr int kSteps = 12;
  Vector q = p;
  for (int step = 0; step < kSteps; ++step) {
    const Vector found = place(q[0], q[1]);
    q = {q[0] + p[0] - found[0], q[1] + p[1] - found[1]};
  }
  return q;
}

// A position between the lines of a regular grid: the lower line and the part of the upper one.
struct GridPosition {
  std::int64_t lower;
  double part;
  GridPosition(double at, std::int64_t count) {
    const double inside = std::clamp(at, 0.0, static_cast<double>(count - 1));
    lower = std::min(static_cast<std::int64_t>(inside), count - 2);
    part = inside - static_cast<double>(lower);
  }
};

// Returns x and y of Ry(tilt) Rx(x tilt) (X, Y, 0).
Vector projected(const Vector& point, const ViewAngles& angles) {
  const double tilt = to_radians(angles.tilt_deg), x_tilt = to_radians(angles.x_tilt_deg);
  return {point[0] * std::cos(tilt) + point[1] * std::sin(x_tilt) * std::sin(tilt),
          point[1] * std::cos(x_tilt)};
}

// Returns the point (X, Y, 0) that is projected to q.
Vector middle_point(const Vector& q, const ViewAngles& angles) {
  const double tilt = to_radians(angles.tilt_deg), x_tilt = to_radians(angles.x_tilt_deg);
  const double y = q[1] / std::cos(x_tilt);
  return {(q[0] - y * std::sin(x_tilt) * std::sin(tilt)) / std::cos(tilt), y};
}

}  // namespace

FittedWarp warp_through(double width_px, double height_px, const LocalPlace& place) {
  FittedWarp fitted{.warp = {.width_px = width_px, .height_px = height_px}};
  const auto displacement = [&](double x, double y) {
    const Vector q = aligned_place(place, {x, y});
    return Vector{q[0] - x, q[1] - y};
  };
  for (int row = 0; row < ViewWarp::kNodes; ++row) {
    for (int column = 0; column < ViewWarp::kNodes; ++column) {
      const Vector at = fitted.warp.node_place(row, column);
      fitted.warp.nodes[static_cast<std::size_t>(row * ViewWarp::kNodes + column)] =
          displacement(at[0], at[1]);
    }
  }
  constexpr int kPlaces = 16;
  double squares = 0.0;
  for (int row = 0; row < kPlaces; ++row) {
    for (int column = 0; column < kPlaces; ++column) {
      const double x = ((column + 0.5) / kPlaces - 0.5) * width_px;
      const double y = ((row + 0.5) / kPlaces - 0.5) * height_px;
      const Vector wanted = displacement(x, y), found = fitted.warp.displacement(x, y);
      squares += std::pow(wanted[0] - found[0], 2) + std::pow(wanted[1] - found[1], 2);
      const Vector stated = place(x, y);
      fitted.largest_stated_px =
          std::max(fitted.largest_stated_px, std::hypot(stated[0] - x, stated[1] - y));
    }
  }
  fitted.rms_px = std::sqrt(fitted.warp.mean_square());
  fitted.left_over_px = std::sqrt(squares / (kPlaces * kPlaces));
  return fitted;
}

LocalPlace place_of_aretomo(std::vector<io::AreTomoPatch> patches, double rotation_deg,
                            double width_px, double height_px) {
  const double cosine = std::cos(to_radians(rotation_deg)),
               sine = std::sin(to_radians(rotation_deg));
  return [=, all = std::move(patches)](double x, double y) {
    constexpr double kSharpness = 100.0;
    const double ax = cosine * x - sine * y, ay = sine * x + cosine * y;
    double sum_x = 0.0, sum_y = 0.0, sum = 0.0;
    for (const io::AreTomoPatch& patch : all) {
      const double dx = (ax - patch.x_px) / width_px, dy = (ay - patch.y_px) / height_px;
      const double weight = std::exp(-kSharpness * (dx * dx + dy * dy));
      sum_x += weight * patch.shift_x_px;
      sum_y += weight * patch.shift_y_px;
      sum += weight;
    }
    if (!(sum > 0.0)) return Vector{x, y};  // there is no patch, or all are too far away
    const double lx = sum_x / sum, ly = sum_y / sum;
    return Vector{x + cosine * lx + sine * ly, y - sine * lx + cosine * ly};
  };
}

double mean_tilt_change_deg(const io::ImodLocal& local, std::int64_t section) {
  double sum = 0.0;
  const std::int64_t parts = local.columns * local.rows;
  for (std::int64_t part = 0; part < parts; ++part)
    sum += local.parts[static_cast<std::size_t>(part * local.num_sections + section)].tilt_deg;
  return sum / static_cast<double>(parts);
}

LocalPlace place_of_imod(const io::ImodLocal& local, std::int64_t section, const ViewAngles& stated,
                         const ViewAngles& angles, double width_px, double height_px,
                         double scale) {
  const auto project_by = [&local, section, stated, scale](std::int64_t row, std::int64_t column,
                                                           const Vector& point) {
    const io::ImodLocalPart& part = local.parts[static_cast<std::size_t>(
        (row * local.columns + column) * local.num_sections + section)];
    const Vector q =
        projected(point, {stated.tilt_deg + part.tilt_deg, stated.x_tilt_deg + part.x_tilt_deg});
    const io::ImodTransform& t = part.transform;
    return Vector{t.a11 * q[0] + t.a12 * q[1] + scale * t.shift_x_px,
                  t.a21 * q[0] + t.a22 * q[1] + scale * t.shift_y_px};
  };
  return [=, &local](double x, double y) {
    const Vector point = middle_point({x, y}, angles);
    // The middle of N pixels is at N / 2 + 1/2, counted from 1.
    const GridPosition column(
        (point[0] + width_px / 2 + 0.5 - scale * local.first_x_px) / (scale * local.step_x_px),
        local.columns);
    const GridPosition row(
        (point[1] + height_px / 2 + 0.5 - scale * local.first_y_px) / (scale * local.step_y_px),
        local.rows);
    Vector sum{};
    for (const std::int64_t r : {0, 1}) {
      for (const std::int64_t c : {0, 1}) {
        const double weight =
            (r == 1 ? row.part : 1 - row.part) * (c == 1 ? column.part : 1 - column.part);
        const Vector p = project_by(row.lower + r, column.lower + c, point);
        sum = {sum[0] + weight * p[0], sum[1] + weight * p[1]};
      }
    }
    return sum;
  };
}

}  // namespace tomofield::tilt_series
