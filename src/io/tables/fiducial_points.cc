#include "io/tables/fiducial_points.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

constexpr std::size_t kMinColumns = 3, kMaxColumns = 5;

// The file of points, for messages.
struct PointFile {
  const std::filesystem::path& path;
  const char* what;  // "fiducials"
};

[[noreturn]] void refuse(const PointFile& file, const TextLine& line, const std::string& fault) {
  throw Error(fmt::format(
      "'{}', line {}: '{}' {}; a line of the text of {} is 'x y z', 'contour x y z' or 'object "
      "contour x y z', as model2point writes it",
      file.path.string(), line.number, quote(line.text), fault, file.what));
}

// The numbers of the object and the contour of a point, as far as its line has them.
using Places = std::vector<double>;

FiducialPoint parse_point(const PointFile& file, const TextLine& line,
                          const std::vector<std::string_view>& words, Places& before) {
  std::vector<double> numbers;
  for (const std::string_view word : words) {
    const auto number = parse_number(word, base::kLargestPosition_px);
    if (!number) {
      refuse(file, line, fmt::format("has '{}', which is no position", quote(word)));
    }
    numbers.push_back(*number);
  }
  const std::size_t first = numbers.size() - 3;
  for (std::size_t i = 0; i < first; ++i)
    if (numbers[i] < 0 || numbers[i] != std::floor(numbers[i]))
      refuse(file, line, fmt::format("has '{}', which numbers no object or contour", words[i]));
  Places here(numbers.begin(), numbers.begin() + static_cast<std::ptrdiff_t>(first));
  if (here < before)
    refuse(file, line,
           "has objects and contours in another order than they are numbered in: are these "
           "positions, and scores behind them?");
  before = std::move(here);
  return {numbers[first], numbers[first + 1], numbers[first + 2], line.number};
}

// Tells whether the last column has scores from 0 to 1, and so the first no numbers of contours.
bool has_scores(const std::vector<FiducialPoint>& points) {
  const auto is_part = [](const FiducialPoint& point) {
    return point.section > 0 && point.section < 1;
  };
  const auto is_score = [](const FiducialPoint& point) {
    return point.section >= 0 && point.section <= 1;
  };
  return std::ranges::all_of(points, is_score) && std::ranges::any_of(points, is_part);
}

}  // namespace

std::vector<FiducialPoint> read_fiducial_points(const std::filesystem::path& path,
                                                const char* what) {
  const PointFile file{path, what};
  std::vector<FiducialPoint> points;
  std::size_t num_columns = 0;
  Places before;
  for (const TextLine& line : read_text_lines(path)) {
    const auto words = split_words(line.text);
    if (words.size() < kMinColumns || words.size() > kMaxColumns) {
      refuse(file, line, fmt::format("has {} columns", words.size()));
    }
    if (num_columns != 0 && words.size() != num_columns) {
      refuse(
          file, line,
          fmt::format("has {} columns where the lines before have {}", words.size(), num_columns));
    }
    num_columns = words.size();
    points.push_back(parse_point(file, line, words, before));
  }
  if (points.empty()) throw Error(fmt::format("'{}' holds no {}", path.string(), what));
  if (num_columns > kMinColumns && has_scores(points))
    throw Error(fmt::format(
        "'{}' has numbers from 0 to 1 alone in its last column, where z is expected: are these "
        "scores? Give the columns x y z alone, or z in voxels",
        path.string()));
  return points;
}

}  // namespace tomofield::io
