#include <algorithm>
#include <cmath>

#include "io/tables/alignment_files.h"
#include "io/tables/text_lines.h"

namespace tomofield::io {
namespace {

// Returns the word after `key` and an equals sign, without a comma or bracket at its end.
std::optional<std::string_view> word_after(std::string_view title, std::string_view key) {
  const std::size_t at = title.find(key);
  if (at == std::string_view::npos) return std::nullopt;
  const std::string_view rest = trim(title.substr(at + key.size()));
  if (!rest.starts_with('=')) return std::nullopt;
  const std::string_view value = trim(rest.substr(1));
  return value.substr(0, value.find_first_of(" ,]\t"));
}

bool are_equal_angles(double a_deg, double b_deg) {
  constexpr double kRounding_deg = 0.11;  // both are written with one or two decimals
  return std::fabs(std::remainder(a_deg - b_deg, 360.0)) < kRounding_deg;
}

}  // namespace

std::optional<std::string_view> axis_of_title(std::string_view title) {
  return word_after(title, "ilt axis angle");
}

std::optional<std::string_view> tomography_axis_of_title(std::string_view title) {
  return word_after(title, "TiltAxisAngle");
}

bool are_two_axes(double a_deg, double b_deg) {
  constexpr double kSame_deg = 1.0;
  return std::fabs(std::remainder(a_deg - b_deg, 360.0)) > kSame_deg;
}

std::vector<double> axes_of_labels(const std::vector<std::string>& labels) {
  std::vector<double> axes_deg;
  for (const std::string& label : labels) {
    const auto word = axis_of_title(label);
    const auto axis_deg = word ? parse_number(*word, base::kLargestAngle_deg) : std::nullopt;
    if (axis_deg &&
        std::ranges::all_of(axes_deg, [&](double other) { return are_two_axes(*axis_deg, other); }))
      axes_deg.push_back(*axis_deg);
  }
  return axes_deg;
}

void set_axis_of_tomography(const AxisAngle& stated, bool is_title, Mdoc& mdoc) {
  const double axis_deg = stated.value;
  const auto rotation_deg = mdoc.sections.front().rotation_deg;
  const auto set = [&](double angle_deg) {
    mdoc.tilt_axis_deg = AxisAngle{angle_deg, stated.line};
  };
  if (rotation_deg && are_equal_angles(axis_deg, -*rotation_deg - 90.0)) return set(*rotation_deg);
  if (!is_title) return set(axis_deg);
  if (rotation_deg && are_equal_angles(axis_deg, *rotation_deg - 90.0)) return set(axis_deg);
  if (rotation_deg && are_equal_angles(axis_deg, -*rotation_deg + 90.0)) return set(-axis_deg);
  mdoc.unclear_axis_deg = stated;
}

}  // namespace tomofield::io
