#include "output/volume_frame.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "align/alignment_record.h"
#include "base/log.h"
#include "io/is_file.h"
#include "output/output_paths.h"
#include "tomofield/error.h"

namespace tomofield::output {
namespace {

using field::Point;
using field::Rotation;

Point turned(const Rotation& rotation, const Point& p) {
  Point result{};
  for (std::size_t a = 0; a < 3; ++a)
    result[a] = rotation[a][0] * p[0] + rotation[a][1] * p[1] + rotation[a][2] * p[2];
  return result;
}

Rotation product(const Rotation& a, const Rotation& b) {
  Rotation result{};
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t column = 0; column < 3; ++column)
      for (std::size_t k = 0; k < 3; ++k) result[row][column] += a[row][k] * b[k][column];
  return result;
}

Rotation transposed(const Rotation& rotation) {
  Rotation result{};
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t column = 0; column < 3; ++column) result[row][column] = rotation[column][row];
  return result;
}

Point turned_about(const Point& centre, const Rotation& rotation, const Point& point) {
  Point from_centre{};
  for (std::size_t a = 0; a < 3; ++a) from_centre[a] = point[a] - centre[a];
  Point at = turned(rotation, from_centre);
  for (std::size_t a = 0; a < 3; ++a) at[a] += centre[a];
  return at;
}

field::OrientedBox turned_about(const Point& centre, const Rotation& rotation,
                                const field::OrientedBox& box) {
  if (rotation == field::kNoRotation) return box;
  field::OrientedBox result = box;
  result.centre_px = turned_about(centre, rotation, box.centre_px);
  result.field_from_box = product(rotation, box.field_from_box);
  return result;
}

// Returns D Ry(pitch) Rx(alpha) D. A mirrored Z turns the other way.
Rotation rotation(double pitch_deg, double alpha_deg, int hand) {
  constexpr double kDegree = std::numbers::pi / 180.0;
  const double p = hand * pitch_deg * kDegree, a = hand * alpha_deg * kDegree;
  const Rotation about_y{
      {{std::cos(p), 0, std::sin(p)}, {0, 1, 0}, {-std::sin(p), 0, std::cos(p)}}};
  const Rotation about_x{
      {{1, 0, 0}, {0, std::cos(a), -std::sin(a)}, {0, std::sin(a), std::cos(a)}}};
  return product(about_y, about_x);
}

// Returns an angle, or 0 if the views are not sure of it. Its standard error is from eight parts of
// the rows, so that five of them are as rare as three that are known (Student's t, six degrees of
// freedom).
double sure_angle(double angle_deg, double error_deg) {
  constexpr double kSure = 5.0;
  return std::abs(angle_deg) >= kSure * error_deg ? angle_deg : 0.0;
}

// Throws Error if an alignment is of another series than a model: it was made from something else
// than the alignment before the fit, or has no view at an angle of the model. Warns if the model
// was not aligned before the fit.
void require_own(const ModelInfo& model, const alignment::AlignmentRecord& record,
                 const std::filesystem::path& path) {
  constexpr double kSame_deg = 0.02;  // angles are written with some digits
  if (!model.alignment_json.empty()) {
    const auto own = alignment::origin_from_text(model.alignment_json);
    if (const std::string why = alignment::difference_of(record.origin, own); !why.empty())
      throw Error(fmt::format("{}, and the model was aligned by another one", why));
    return;
  }
  for (const double tilt_deg : model.geometry.tilt_deg) {
    const auto is_there = [&](const alignment::AlignedView& view) {
      const double change_deg = tilt_deg - view.tilt_deg;
      return std::abs(change_deg) <= kSame_deg ||
             std::abs(change_deg - view.tilt_change_deg) <= kSame_deg;
    };
    if (std::ranges::none_of(record.views, is_there))
      throw Error(fmt::format(
          "it is of another series: the model has a view at {:.2f}°, and this alignment has none",
          tilt_deg));
  }
  base::log_warning(
      fmt::format("the model was not aligned by '{}', which --align wrote for the same tilts: it "
                  "is levelled as if it was of its views (--level PITCH,X_TILT gives other angles)",
                  path.string()));
}

// Says which angles the alignment found, and warns if they are hard to believe.
void tell_levelling(const Levelling& found) {
  constexpr double kUsual_deg = 12.0;  // sections of frozen cells lie flatter
  const std::string angles = fmt::format("a pitch of {:.1f}° and a tilt about X of {:.1f}°",
                                         found.pitch_deg, found.x_tilt_deg);
  base::log_info(fmt::format("levelled by {}; 0 is what the views are not sure of", angles));
  if (std::abs(found.pitch_deg) > kUsual_deg || std::abs(found.x_tilt_deg) > kUsual_deg / 2)
    base::log_warning(fmt::format(
        "{} are much for a frozen specimen, and noisy views give angles that are surer than "
        "right: look at the XZ and YZ planes, or give --level PITCH,X_TILT",
        angles));
}

}  // namespace

Levelling found_levelling(const ModelInfo& model, const std::filesystem::path& file) {
  constexpr const char* kAdvice = "give both angles in degrees: --level PITCH,X_TILT";
  const std::filesystem::path path = output_paths(file).alignment;
  if (!io::is_file(path)) {
    throw Error(
        fmt::format("there is no '{}' beside '{}', which --align writes, to level it by: {}",
                    path.string(), file.string(), kAdvice));
  }
  try {
    const alignment::AlignmentRecord record = alignment::read_record(path);
    require_own(model, record, path);
    if (!record.pose) throw Error("the views could not tell the pitch");
    const auto& [pose, error] = *record.pose;
    const Levelling found{.pitch_deg = sure_angle(pose.pitch_deg, error.pitch_deg),
                          .x_tilt_deg = sure_angle(pose.x_tilt_deg, error.x_tilt_deg)};
    if (found.pitch_deg == 0.0 && found.x_tilt_deg == 0.0) {
      throw Error(
          fmt::format("it is level as far as the views tell, with a pitch of {:.1f} ± {:.1f}° and "
                      "a tilt about X "
                      "of {:.1f} ± {:.1f}°, and only angles of five standard errors are used",
                      pose.pitch_deg, error.pitch_deg, pose.x_tilt_deg, error.x_tilt_deg));
    }
    tell_levelling(found);
    return found;
  } catch (const std::exception& error) {
    throw Error(
        fmt::format("'{}' has nothing to level the specimen by: {}; leave --level out, or "
                    "{}",
                    path.string(), error.what(), kAdvice));
  }
}

VolumeFrame::VolumeFrame(const ModelInfo& model, const Levelling& levelling)
    : centre_{model.geometry.axis_x, static_cast<double>(model.geometry.height) / 2,
              model.geometry.axis_z},
      field_from_volume_(rotation(levelling.pitch_deg, model.x_tilt_deg - levelling.x_tilt_deg,
                                  model.geometry.hand)) {}

Point VolumeFrame::to_field(const Point& point) const {
  return turned_about(centre_, field_from_volume_, point);
}

field::OrientedBox VolumeFrame::to_field(const field::OrientedBox& box) const {
  return turned_about(centre_, field_from_volume_, box);
}

field::OrientedBox VolumeFrame::from_field(const field::OrientedBox& box) const {
  field::OrientedBox found = turned_about(centre_, transposed(field_from_volume_), box);
  constexpr double kRounding = 1e-9;
  double largest = 0.0;
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t a = 0; a < 3; ++a)
      largest =
          std::max(largest, std::abs(found.field_from_box[row][a] - field::kNoRotation[row][a]));
  if (largest < kRounding) found.field_from_box = field::kNoRotation;
  return found;
}

}  // namespace tomofield::output
