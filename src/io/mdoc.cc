#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "io/alignment_files.h"
#include "io/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

struct KeyValue {
  std::string_view key, value;
};

/// Splits "key = value". Returns an empty key for lines of another form.
KeyValue split_key_value(std::string_view text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string_view::npos) return {};
  return {trim(text.substr(0, equals)), trim(text.substr(equals + 1))};
}

double require_number(const std::filesystem::path& path, const TextLine& line,
                      std::string_view word, double largest) {
  const auto value = parse_number(word, largest);
  if (value) return *value;
  throw Error(fmt::format("'{}', line {}: '{}' does not give a number from -{} to {}",
                          path.string(), line.number, quote(line.text), largest, largest));
}

/// Returns n of "[ZValue = n]", and nothing for other heads such as "[T = …]" and
/// "[MontSection = …]".
std::optional<std::int64_t> parse_section_head(const std::filesystem::path& path,
                                               const TextLine& line) {
  const std::string_view inside = std::string_view(line.text).substr(1, line.text.find(']') - 1);
  const KeyValue head = split_key_value(inside);
  if (head.key != "ZValue") return std::nullopt;
  const auto section = parse_integer(head.value);
  if (section && *section >= 0) return *section;
  throw Error(fmt::format("'{}', line {}: '{}' does not give a section number", path.string(),
                          line.number, quote(line.text)));
}

void sort_and_require_unique(const std::filesystem::path& path, Mdoc* mdoc) {
  auto& sections = mdoc->sections;
  std::stable_sort(
      sections.begin(), sections.end(),
      [](const MdocSection& a, const MdocSection& b) { return a.section < b.section; });
  for (std::size_t i = 1; i < sections.size(); ++i) {
    if (sections[i].section == sections[i - 1].section) {
      throw Error(fmt::format("'{}', line {}: section [ZValue = {}] comes twice", path.string(),
                              sections[i].line, sections[i].section));
    }
  }
}

}  // namespace

Mdoc read_mdoc(const std::filesystem::path& path) {
  Mdoc mdoc;
  bool is_in_section = false;
  for (const TextLine& line : read_text_lines(path)) {
    if (line.text.starts_with('[')) {
      const auto section = parse_section_head(path, line);
      // Titles "[T = …]" stand anywhere. They do not end a section.
      if (section) mdoc.sections.push_back({*section, line.number, {}, {}});
      is_in_section = is_in_section || section.has_value();
      continue;
    }
    const KeyValue entry = split_key_value(line.text);
    if (entry.key == "PixelSpacing") {
      const double spacing_A = require_number(path, line, entry.value, base::kLargestNumber);
      if (!mdoc.pixel_spacing_A) mdoc.pixel_spacing_A = spacing_A;
      if (is_in_section) mdoc.sections.back().pixel_spacing_A = spacing_A;
    } else if (entry.key == "TiltAngle" && is_in_section) {
      mdoc.sections.back().tilt_deg =
          require_number(path, line, entry.value, base::kLargestAngle_deg);
      mdoc.sections.back().line = line.number;
    }
  }
  if (mdoc.sections.empty()) {
    throw Error(fmt::format("'{}' has no sections, [ZValue = 0] and so on: is it an .mdoc file?",
                            path.string()));
  }
  sort_and_require_unique(path, &mdoc);
  return mdoc;
}

}  // namespace tomofield::io
