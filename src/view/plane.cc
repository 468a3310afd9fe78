#include "view/plane.h"

#include <fmt/format.h>

#include <cmath>
#include <string_view>

#include "base/plausible.h"
#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::view {
namespace {

constexpr double kSmallestStep = 1e-6;

const std::string& text_of(const Parameters& parameters, const char* name) {
  if (const auto at = parameters.find(name); at != parameters.end()) return at->second;
  throw Error(fmt::format("'{}' is missing", name));
}

double number_from(std::string_view text, const char* name) {
  if (const auto number = io::parse_number(text)) return *number;
  throw Error(fmt::format("'{}' must be a number, not '{}'", name, io::quote(text)));
}

Point point_from(const Parameters& parameters, const char* name) {
  const std::string& text = text_of(parameters, name);
  std::string_view rest = text;
  Point point{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t comma = axis < 2 ? rest.find(',') : rest.size();
    if (comma == std::string_view::npos)
      throw Error(fmt::format("'{}' must be three numbers with commas between them", name));
    point[axis] = number_from(rest.substr(0, comma), name);
    rest.remove_prefix(axis < 2 ? comma + 1 : comma);
  }
  return point;
}

double dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

void require_right_angle(const Plane& plane) {
  constexpr double kTolerance = 1e-6;
  if (std::fabs(dot(plane.right, plane.right) - 1) < kTolerance &&
      std::fabs(dot(plane.up, plane.up) - 1) < kTolerance &&
      std::fabs(dot(plane.right, plane.up)) < kTolerance)
    return;
  throw Error("'right' and 'up' must have length 1 and be at right angles");
}

}  // namespace

Point Plane::position(double column, double row) const {
  const double x = (column - 0.5 * static_cast<double>(width)) * step;
  const double y = (row - 0.5 * static_cast<double>(height)) * step;
  Point at = centre;
  for (std::size_t axis = 0; axis < 3; ++axis) at[axis] += x * right[axis] + y * up[axis];
  return at;
}

std::int64_t requested_number(const Parameters& parameters, const char* name,
                              std::int64_t largest) {
  const std::string& text = text_of(parameters, name);
  const auto number = io::parse_integer(text);
  if (number && *number >= 0 && *number <= largest) return *number;
  throw Error(fmt::format("'{}' must be a whole number from 0 to {}, not '{}'", name, largest,
                          io::quote(text)));
}

Plane requested_plane(const Parameters& parameters) {
  Plane plane{.centre = point_from(parameters, "center"),
              .right = point_from(parameters, "right"),
              .up = point_from(parameters, "up"),
              .width = requested_number(parameters, "width", kLargestSide_px),
              .height = requested_number(parameters, "height", kLargestSide_px),
              .step = number_from(text_of(parameters, "step"), "step")};
  if (plane.width == 0 || plane.height == 0) throw Error("'width' and 'height' must be above 0");
  if (plane.step < kSmallestStep)
    throw Error(fmt::format("'step' must be at least {}", kSmallestStep));
  require_right_angle(plane);
  return plane;
}

}  // namespace tomofield::view
