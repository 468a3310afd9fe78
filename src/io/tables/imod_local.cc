#include "io/tables/imod_local.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

#include "base/plausible.h"
#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

constexpr std::size_t kFewestOfHead = 6;

[[noreturn]] void refuse_line(const std::filesystem::path& path, const TextLine& line,
                              std::string_view expected) {
  throw Error(fmt::format("'{}', line {}: '{}' is not {}", path.string(), line.number,
                          quote(line.text), expected));
}

std::vector<double> numbers_of(const std::filesystem::path& path, const TextLine& line) {
  std::vector<double> numbers;
  for (const std::string_view word : split_words(line.text)) {
    const auto number = parse_number(word, base::kLargestPosition_px);
    if (!number) refuse_line(path, line, "a line of numbers of IMOD's local alignments");
    numbers.push_back(*number);
  }
  return numbers;
}

// The numbers of the first line of a file.
struct Head {
  ImodLocal grid;
  bool has_x_tilts = false, has_z_factors = false;
};

// Returns the pixel size that the first line states. Throws Error for one that no image has.
double stated_pixel_size(const std::filesystem::path& path, const TextLine& line, double size_A) {
  if (base::is_plausible_pixel_size(size_A)) return size_A;
  throw Error(fmt::format(
      "'{}', line {}: '{}' states pixels of {:g} Å, the eighth number, and pixels have {} to {} Å: "
      "correct it, or delete the numbers from it on",
      path.string(), line.number, quote(line.text), size_A, base::kPixelSizes_A.low(),
      base::kPixelSizes_A.high()));
}

// Parses "columns rows x y dx dy [has x tilts] [pixel size] [has Z factors]".
Head parse_head(const std::filesystem::path& path, const TextLine& line) {
  constexpr double kMostParts = 1000;
  constexpr const char* kForm =
      "the first line of IMOD's local alignments: at least 2 columns and 2 rows of parts, the "
      "place of the first one, and their distances";
  const std::vector<double> n = numbers_of(path, line);
  if (n.size() < kFewestOfHead) refuse_line(path, line, kForm);
  for (const double count : {n[0], n[1]})
    if (count < 2 || count > kMostParts || count != std::round(count))
      refuse_line(path, line, kForm);
  if (n[4] <= 0 || n[5] <= 0) refuse_line(path, line, kForm);
  Head head;
  head.grid = {.columns = static_cast<std::int64_t>(n[0]),
               .rows = static_cast<std::int64_t>(n[1]),
               .first_x_px = n[2],
               .first_y_px = n[3],
               .step_x_px = n[4],
               .step_y_px = n[5],
               .parts = {}};
  const auto further = [&](std::size_t i) { return n.size() > i ? n[i] : 0.0; };
  head.has_x_tilts = further(6) > 0;
  if (n.size() > 7) head.grid.pixel_size_A = stated_pixel_size(path, line, n[7]);
  head.has_z_factors = further(8) > 0;
  return head;
}

// Follows the lines of a file as tiltalign writes them: for each part lists of numbers, each of
// which ends with a line, and a line of six numbers for each section.
class Lines {
 public:
  Lines(std::span<const TextLine> lines, std::int64_t num_sections)
      : lines_(lines), num_sections_(num_sections) {}

  // Returns the first line that is none of these; the last one if lines are missing.
  const TextLine& first_odd(std::int64_t num_parts, std::int64_t lists_of_part) {
    for (std::int64_t part = 0; part < num_parts; ++part) {
      for (std::int64_t list = 0; list < lists_of_part; ++list)
        if (!skip_list(num_sections_)) return odd();
      for (std::int64_t section = 0; section < num_sections_; ++section)
        if (!skip_list(kNumbersOfTransform)) return odd();
    }
    return odd();
  }

 private:
  static constexpr std::int64_t kNumbersOfTransform = 6;

  bool skip_list(std::int64_t count) {
    for (; count > 0 && at_ < lines_.size(); ++at_) {
      const std::int64_t of_line = std::ssize(split_words(lines_[at_].text));
      if (of_line > count || (count == kNumbersOfTransform && of_line < count)) return false;
      count -= of_line;
    }
    return count == 0;
  }
  const TextLine& odd() const { return lines_[std::min(at_, lines_.size() - 1)]; }

  std::span<const TextLine> lines_;
  std::int64_t num_sections_;
  std::size_t at_ = 1;  // after the head
};

// Throws Error unless a file has as many numbers as its parts of these sections need.
void require_count(const std::filesystem::path& path, std::span<const TextLine> lines,
                   const Head& head, std::int64_t count, std::int64_t num_sections) {
  const std::int64_t lists = 1 + (head.has_x_tilts ? 1 : 0) + (head.has_z_factors ? 2 : 0);
  const std::int64_t num_parts = head.grid.columns * head.grid.rows;
  const std::int64_t of_section = num_parts * (6 + lists);
  if (count == of_section * num_sections) return;
  if (count > 0 && count % of_section == 0)
    throw Error(fmt::format(
        "'{}' has {} numbers for {} × {} parts, which are {} sections, and the stack has {}: "
        "give the local alignments of this stack",
        path.string(), count, head.grid.columns, head.grid.rows, count / of_section, num_sections));
  const TextLine& odd = Lines(lines, num_sections).first_odd(num_parts, lists);
  throw Error(fmt::format(
      "'{}' has {} numbers, and {} × {} parts of the {} sections of the stack have {}: from line "
      "{} on, '{}', lines or numbers are missing or of another stack",
      path.string(), count, head.grid.columns, head.grid.rows, num_sections,
      of_section * num_sections, odd.number, quote(odd.text)));
}

// Hands out the numbers that follow each other in a file.
class Numbers {
 public:
  explicit Numbers(std::span<const double> all) : all_(all) {}
  std::span<const double> next(std::int64_t count) {
    const auto part = all_.subspan(at_, static_cast<std::size_t>(count));
    at_ += part.size();
    return part;
  }

 private:
  std::span<const double> all_;
  std::size_t at_ = 0;
};

void read_part(const std::filesystem::path& path, const Head& head, Numbers& numbers,
               std::span<ImodLocalPart> of_section) {
  const auto count = std::ssize(of_section);
  const auto set = [&](double ImodLocalPart::*angle) {
    const auto angles = numbers.next(count);
    for (std::size_t i = 0; i < of_section.size(); ++i) of_section[i].*angle = angles[i];
  };
  set(&ImodLocalPart::tilt_deg);
  if (head.has_x_tilts) set(&ImodLocalPart::x_tilt_deg);
  if (head.has_z_factors) numbers.next(2 * count);
  for (ImodLocalPart& part : of_section) {
    const auto t = numbers.next(6);
    part.transform = {t[0], t[1], t[2], t[3], t[4], t[5]};
    constexpr double kSmallest = 0.5;            // no part is half as large as another
    constexpr double kLargestChange_deg = 30.0;  // of the tilt, by a local alignment
    if (std::abs(part.tilt_deg) > kLargestChange_deg)
      throw Error(
          fmt::format("'{}' changes the tilt of a part by {}°, and a local alignment changes "
                      "it by at most {}°: the file is damaged, or is not of this series",
                      path.string(), part.tilt_deg, kLargestChange_deg));
    if (t[0] * t[3] - t[1] * t[2] < kSmallest)
      throw Error(
          fmt::format("'{}' has a local alignment by {} {} {} {} {} {}, which no part of a "
                      "view can have: the file is damaged, or is not of this series",
                      path.string(), t[0], t[1], t[2], t[3], t[4], t[5]));
  }
}

}  // namespace

ImodLocal read_imod_local(const std::filesystem::path& path, std::int64_t num_sections) {
  const std::vector<TextLine> lines = read_text_lines(path);
  if (lines.empty()) throw Error(fmt::format("'{}' has no local alignments", path.string()));
  Head head = parse_head(path, lines.front());
  std::vector<double> values;
  for (const TextLine& line : std::span(lines).subspan(1)) {
    const auto numbers = numbers_of(path, line);
    values.insert(values.end(), numbers.begin(), numbers.end());
  }
  ImodLocal& local = head.grid;
  const std::int64_t num_parts = local.columns * local.rows;
  require_count(path, lines, head, std::ssize(values), num_sections);
  local.num_sections = num_sections;
  local.parts.resize(static_cast<std::size_t>(num_parts * num_sections));
  Numbers numbers(values);
  for (std::int64_t part = 0; part < num_parts; ++part)
    read_part(path, head, numbers,
              std::span(local.parts)
                  .subspan(static_cast<std::size_t>(part * num_sections),
                           static_cast<std::size_t>(num_sections)));
  return local;
}

}  // namespace tomofield::io
