#include "io/tables/alignment_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

[[noreturn]] void throw_line_error(const std::filesystem::path& path, const TextLine& line,
                                   std::string_view expected) {
  throw Error(fmt::format("'{}', line {}: '{}' is not {}", path.string(), line.number,
                          quote(line.text), expected));
}

// Tells whether a matrix is invertible and stretches no direction by less than 1 / kLargestStretch
// or more than kLargestStretch. `determinant` is positive or, with a mirror, negative.
bool is_plausible_matrix(const ImodTransform& t) {
  constexpr double kLargestStretch = 100.0;
  const double determinant = std::fabs(t.a11 * t.a22 - t.a12 * t.a21);
  const double squares = t.a11 * t.a11 + t.a12 * t.a12 + t.a21 * t.a21 + t.a22 * t.a22;
  // The singular values: their squares have the sum `squares` and the product determinant².
  const double difference =
      std::sqrt(std::max(squares * squares - 4 * determinant * determinant, 0.0));
  const double largest = std::sqrt((squares + difference) / 2);
  return determinant > 0 && largest <= kLargestStretch && determinant >= largest / kLargestStretch;
}

bool is_mirror(const ImodTransform& t) { return t.a11 * t.a22 - t.a12 * t.a21 < 0.0; }

// Throws Error if some transforms mirror the images and others do not: the views of a series are
// all mirrored or none. `lines` are those of the transforms.
void require_one_hand(const std::filesystem::path& path, const std::vector<TextLine>& lines,
                      const std::vector<ImodTransform>& transforms) {
  const auto num_mirrors = std::ranges::count_if(transforms, is_mirror);
  const bool are_few = 2 * num_mirrors <= std::ssize(transforms);
  for (std::size_t i = 0; i < transforms.size(); ++i) {
    if (is_mirror(transforms[i]) != are_few) continue;
    throw_line_error(path, lines[i],
                     fmt::format("of one series with the others: it {} the image, and most do {}",
                                 are_few ? "mirrors" : "does not mirror", are_few ? "not" : "so"));
  }
}

constexpr std::string_view kForm =
    "a tilt angle, alone, or with its place in the order of recording and its dose, 0 to 10000 "
    "electrons per Å², as in AreTomo 3's _TLT.txt; of any others keep one column, the tilt angles "
    "in degrees from -360 to 360";

}  // namespace

std::vector<NumberLine> read_number_column(const std::filesystem::path& path,
                                           std::string_view quantity) {
  std::vector<NumberLine> numbers;
  for (const TextLine& line : read_text_lines(path)) {
    const auto words = split_words(line.text);
    if (words.size() > 1) {
      throw_line_error(path, line,
                       fmt::format("one number: the file must have one column ({}); with several, "
                                   "keep the right one alone",
                                   quantity));
    }
    const auto value = parse_number(words.front(), base::kLargestAngle_deg);
    if (!value) {
      throw_line_error(path, line, fmt::format("{} from -360 to 360", quantity));
    }
    numbers.push_back({*value, line.number});
  }
  return numbers;
}

TiltTable read_tilt_table(const std::filesystem::path& path) {
  constexpr std::string_view kQuantity = "a tilt angle in degrees";
  const std::vector<TextLine> lines = read_text_lines(path);
  const std::size_t num_columns = lines.empty() ? 1 : split_words(lines.front().text).size();
  if (num_columns < 2 || num_columns > 3) return {read_number_column(path, kQuantity), {}, {}};
  TiltTable table;
  std::map<std::int64_t, std::size_t> recorded;  // section by its number in the order of recording
  for (const TextLine& line : lines) {
    const auto words = split_words(line.text);
    const bool has_columns = words.size() == num_columns;
    const auto tilt = has_columns ? parse_number(words[0], base::kLargestAngle_deg) : std::nullopt;
    const auto number = has_columns ? parse_integer(words[1]) : std::nullopt;
    const auto dose = has_columns ? parse_number(words.back(), {0.0, kLargestDose}) : std::nullopt;
    if (!tilt || !number || !dose) throw_line_error(path, line, kForm);
    if (!recorded.emplace(*number, table.angles.size()).second)
      throw_line_error(path, line,
                       fmt::format("of a view of its own: a line before it has place {} in the "
                                   "order of recording (second column), too",
                                   *number));
    table.angles.push_back({*tilt, line.number});
    if (num_columns == 3) table.doses.push_back(*dose);
  }
  const std::int64_t first = recorded.begin()->first, last = recorded.rbegin()->first;
  if (first < 0 || first > 1 || last - first + 1 != std::ssize(recorded))
    throw_line_error(
        path, lines.front(),
        fmt::format("of a table whose places in the order of recording (second column) run from 0 "
                    "or 1 on without a gap: {} places run from {} to {} here",
                    recorded.size(), first, last));
  for (const auto& [number, section] : recorded) table.order.push_back(section);
  return table;
}

std::vector<ImodTransform> read_imod_transforms(const std::filesystem::path& path) {
  std::vector<ImodTransform> transforms;
  const std::vector<TextLine> lines = read_text_lines(path);
  for (const TextLine& line : lines) {
    const auto words = split_words(line.text);
    std::array<double, 6> values{};
    bool is_valid = words.size() == values.size();
    for (std::size_t i = 0; is_valid && i < values.size(); ++i) {
      const auto value = parse_number(words[i], base::kLargestPosition_px);
      is_valid = value.has_value();
      values[i] = value ? double{*value} : 0.0;
    }
    if (!is_valid)
      throw_line_error(path, line, "a transform of six numbers: A11 A12 A21 A22 DX DY");
    const auto [a11, a12, a21, a22, dx, dy] = values;
    transforms.push_back({a11, a12, a21, a22, dx, dy});
    if (!is_plausible_matrix(transforms.back())) {
      throw_line_error(path, line,
                       "an alignment: A11 A12 A21 A22 must keep every direction, and stretch none "
                       "by less than 0.01 or more than 100");
    }
  }
  require_one_hand(path, lines, transforms);
  return transforms;
}

std::string section_list(std::span<const std::int64_t> sections) {
  std::vector<std::string> items;
  for (std::size_t first = 0, last = 0; first < sections.size(); first = last + 1) {
    last = first;
    while (last + 1 < sections.size() && sections[last + 1] == sections[last] + 1) ++last;
    if (last > first + 1) {
      items.push_back(fmt::format("{}-{}", sections[first], sections[last]));
    } else {
      for (std::size_t i = first; i <= last; ++i) items.push_back(std::to_string(sections[i]));
    }
  }
  return fmt::format("{}", fmt::join(items, ","));
}

std::vector<std::int64_t> parse_section_list(std::string_view text, std::int64_t num_sections) {
  std::vector<std::int64_t> sections;
  std::string_view rest = trim(text);
  while (!rest.empty()) {
    const std::size_t comma = std::min(rest.find(','), rest.size());
    const std::string_view item = trim(rest.substr(0, comma));
    const std::size_t dash = item.find('-');
    const auto first = parse_integer(trim(item.substr(0, dash)));
    const auto last =
        dash == std::string_view::npos ? first : parse_integer(trim(item.substr(dash + 1)));
    if (!first || !last || *first > *last) {
      throw Error(fmt::format(
          "'{}' in the list of sections '{}' is neither a number nor a range such as 1-3",
          quote(item), quote(text)));
    }
    if (*first < 1 || *last > num_sections) {
      throw Error(
          fmt::format("the list of sections '{}' asks for {}, but the stack has sections 1 "
                      "to {}",
                      quote(text), quote(item), num_sections));
    }
    for (auto section = *first; section <= *last; ++section) sections.push_back(section - 1);
    rest.remove_prefix(std::min(comma + 1, rest.size()));
  }
  std::sort(sections.begin(), sections.end());
  sections.erase(std::unique(sections.begin(), sections.end()), sections.end());
  return sections;
}

}  // namespace tomofield::io
