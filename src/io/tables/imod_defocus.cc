#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <string>
#include <system_error>
#include <utility>

#include "io/saving/atomic_file.h"
#include "io/tables/ctf_table.h"
#include "io/tables/text_lines.h"
#include "tomofield/error.h"

// IMOD's .defocus (its man page ctfphaseflip, and ctfutils.cpp): lines of first and last view,
// their angles, and the defocus in nm. In version 2, "2" ends the first line. In version 3, the
// first line is "flags 0 0 0 0 3", and the flags say which columns follow the defocus.

namespace tomofield::io {
namespace {

constexpr double kRadians = std::numbers::pi / 180.0;
constexpr double kAngstroms_in_nm = 10.0;
constexpr std::int64_t kMostViews = 100000;

enum Flag : std::int64_t {
  kHasAstigmatism = 1,  // a second defocus, and the direction of the first
  kAngleInRadians = 2,
  kHasPhase = 4,
  kPhaseInRadians = 8,
  kAnglesInverted = 16,  // ctfutils.cpp turns their sign
  kHasCutOn = 32,
};

struct Form {
  std::int64_t version = 2, flags = 0;
  bool has(Flag flag) const { return (flags & flag) != 0; }
};

// Describes the defocus in terms that can be interpolated.
struct Terms {
  double mean_A = 0.0, along_A = 0.0, across_A = 0.0, phase_deg = 0.0;

  static Terms of(const Defocus& d) {
    const double half_A = (d.u_A - d.v_A) / 2, angle = 2 * kRadians * d.angle_deg;
    return {(d.u_A + d.v_A) / 2, half_A * std::cos(angle), half_A * std::sin(angle),
            d.phase_shift_deg};
  }
  Defocus defocus() const {
    const double half_A = std::hypot(along_A, across_A);
    return {mean_A + half_A, mean_A - half_A, std::atan2(across_A, along_A) / (2 * kRadians),
            phase_deg};
  }
};

Defocus between(const Defocus& a, const Defocus& b, double share) {
  const Terms s = Terms::of(a), t = Terms::of(b);
  return Terms{std::lerp(s.mean_A, t.mean_A, share), std::lerp(s.along_A, t.along_A, share),
               std::lerp(s.across_A, t.across_A, share), std::lerp(s.phase_deg, t.phase_deg, share)}
      .defocus();
}

Form form_of(const std::filesystem::path& path, const TextLine& first) {
  const auto words = split_words(first.text);
  const auto version = words.size() == 6 ? parse_integer(words.back()) : std::nullopt;
  if (version == 2) return {2, 0};
  const auto flags = words.empty() ? std::nullopt : parse_integer(words.front());
  if (version == 3 && flags && *flags >= 0 && *flags < 64) return {3, *flags};
  throw Error(fmt::format(
      "'{}', line {}: '{}' does not begin a .defocus file of IMOD, whose first line ends with the "
      "version 2 or 3, and the file has no columns of CTFFIND or AreTomo either: give one of these "
      "(ctfplotter saves an old file again)",
      path.string(), first.number, quote(first.text)));
}

struct Entry {
  std::int64_t first_view = 0, last_view = 0;  // from 0
  double tilt_deg = 0.0;                       // the mean of their angles
  Defocus defocus;
  double range_deg = 0.0;  // between their angles

  // Tells whether the mean angle is that of the middle view: of several views, it is that of a view
  // or lies between two that are near each other.
  bool has_tilt_of_middle() const {
    constexpr double kNear_deg = 4.0;
    const auto count = last_view - first_view + 1;
    return count % 2 == 1 || std::fabs(range_deg) / static_cast<double>(count - 1) < kNear_deg;
  }
};

Entry parse_entry(const std::filesystem::path& path, const TextLine& line, const Form& form,
                  std::size_t num_words) {
  const auto words = split_words(line.text);
  const bool has_astigmatism = form.has(kHasAstigmatism), has_phase = form.has(kHasPhase);
  std::array<double, 9> values{};
  bool is_valid = words.size() == num_words;
  for (std::size_t i = 0; is_valid && i < num_words; ++i) {
    const auto value = parse_number(words[i], kLargestDefocus_A / kAngstroms_in_nm);
    is_valid = value.has_value();
    values[i] = value ? double{*value} : 0.0;
  }
  const auto first = static_cast<std::int64_t>(values[0]),
             last = static_cast<std::int64_t>(values[1]);
  is_valid =
      is_valid && values[0] == static_cast<double>(first) && values[1] == static_cast<double>(last);
  if (!is_valid || first < 1 || last < first || last > kMostViews) {
    throw Error(fmt::format(
        "'{}', line {}: '{}' is not a line of a .defocus file: first and last view, their angles, "
        "defocus in nm{}{}{}",
        path.string(), line.number, quote(line.text),
        has_astigmatism ? ", second defocus in nm, direction of the first" : "",
        has_phase ? ", phase shift" : "", form.has(kHasCutOn) ? ", cut-on frequency" : ""));
  }
  Defocus defocus{kAngstroms_in_nm * values[4], kAngstroms_in_nm * values[4], 0, 0};
  // A second defocus of 0 means that no astigmatism was measured.
  if (has_astigmatism && values[5] != 0.0) {
    defocus.v_A = kAngstroms_in_nm * values[5];
    defocus.angle_deg = form.has(kAngleInRadians) ? values[6] / kRadians : values[6];
  }
  if (has_phase) {
    const double phase = std::abs(values[has_astigmatism ? 7 : 5]);  // as IMOD does
    defocus.phase_shift_deg = form.has(kPhaseInRadians) ? phase / kRadians : phase;
  }
  for (const double angle_deg : {defocus.angle_deg, defocus.phase_shift_deg})
    if (!base::is_plausible(angle_deg, base::kLargestAngle_deg))
      throw Error(fmt::format(
          "'{}', line {}: a direction or phase shift of {:g}° cannot be: correct it, or the flags "
          "{} of the first line, which say what is in radians",
          path.string(), line.number, angle_deg, form.flags));
  const double sign = form.has(kAnglesInverted) ? -1.0 : 1.0;
  for (const std::size_t i : {2, 3})
    if (!base::is_plausible(values[i], base::kLargestAngle_deg))
      throw Error(fmt::format("'{}', line {}: {} is no angle in degrees: correct it", path.string(),
                              line.number, words[i]));
  return {first - 1, last - 1, sign * (values[2] + values[3]) / 2, defocus, values[3] - values[2]};
}

// Returns a defocus for each view. As in IMOD, a line of the file is about the middle view of its
// range; between two of these the defocus changes in proportion, and beyond the last it stays.
std::vector<std::optional<Defocus>> interpolated(const std::map<std::int64_t, Defocus>& at_middle,
                                                 std::int64_t num_views) {
  std::vector<std::optional<Defocus>> views;
  for (std::int64_t view = 0; view < num_views; ++view) {
    const auto next = at_middle.lower_bound(view);
    if (next == at_middle.end()) {
      views.emplace_back(at_middle.rbegin()->second);
    } else if (next == at_middle.begin() || next->first == view) {
      views.emplace_back(next->second);
    } else {
      const auto previous = std::prev(next);
      const double share = static_cast<double>(view - previous->first) /
                           static_cast<double>(next->first - previous->first);
      views.emplace_back(between(previous->second, next->second, share));
    }
  }
  return views;
}

// Tells whether a file is AreTomo's copy for IMOD: NAME_CTF_Imod.txt, or NAME_ctf.txt in the folder
// NAME_Imod (CImodUtil.cpp).
bool is_copy_of_aretomo(const std::filesystem::path& path) {
  std::error_code failed;
  const std::string name = path.filename().string();
  const std::string folder =
      std::filesystem::absolute(path, failed).parent_path().filename().string();
  return name.ends_with("_CTF_Imod.txt") ||
         (name.ends_with("_ctf.txt") && folder.ends_with("_Imod"));
}

}  // namespace

CtfTable read_imod_defocus(const std::filesystem::path& path) {
  if (is_copy_of_aretomo(path)) {
    throw Error(fmt::format(
        "'{}' is AreTomo's copy for IMOD, which has the direction of the other defocus and, with a "
        "phase plate, no angles: give AreTomo's NAME_CTF.txt",
        path.string()));
  }
  std::vector<TextLine> lines = read_text_lines(path);
  if (lines.empty())
    throw Error(fmt::format("'{}' is empty: give a file with a defocus a view", path.string()));
  const Form form = form_of(path, lines.front());
  if (form.version == 3) {
    lines.erase(lines.begin());
  } else {  // the version ends the first line
    lines.front().text.erase(lines.front().text.find_last_not_of('2') + 1);
  }
  const std::size_t num_words = 5 + (form.has(kHasAstigmatism) ? 2 : 0) +
                                (form.has(kHasPhase) ? 1 : 0) + (form.has(kHasCutOn) ? 1 : 0);
  std::map<std::int64_t, Defocus> at_middle;
  std::int64_t num_views = 0;
  std::vector<std::optional<double>> tilts;  // of the views in the middle of a line's
  for (const TextLine& line : lines) {
    const Entry entry = parse_entry(path, line, form, num_words);
    const std::int64_t middle = (entry.first_view + entry.last_view) / 2;
    if (!at_middle.emplace(middle, entry.defocus).second)
      throw Error(fmt::format("'{}', line {}: the defocus of view {} comes twice: leave one out",
                              path.string(), line.number, middle + 1));
    num_views = std::max(num_views, entry.last_view + 1);
    tilts.resize(static_cast<std::size_t>(num_views));
    if (entry.has_tilt_of_middle()) tilts[static_cast<std::size_t>(middle)] = entry.tilt_deg;
  }
  CtfTable table{path, interpolated(at_middle, num_views), {}, {}, std::move(tilts), true};
  if (form.has(kHasCutOn))
    table.not_applied.emplace_back("the cut-on frequencies of the phase plate");
  return table;
}

void write_imod_defocus(const std::filesystem::path& path, std::span<const WrittenCtf> sections) {
  const bool has_phase = std::ranges::any_of(
      sections, [](const WrittenCtf& s) { return s.defocus.phase_shift_deg != 0.0; });
  std::string text = fmt::format("{} 0 0. 0. 0 3\n",
                                 has_phase ? kHasAstigmatism + kHasPhase : kHasAstigmatism + 0);
  for (std::size_t i = 0; i < sections.size(); ++i) {
    const auto& [tilt_deg, defocus] = sections[i];
    text += fmt::format("{0} {0} {1:.2f} {1:.2f} {2:.4f} {3:.4f} {4:.4f}", i + 1, tilt_deg,
                        defocus.u_A / kAngstroms_in_nm, defocus.v_A / kAngstroms_in_nm,
                        defocus.angle_deg);
    text += has_phase ? fmt::format(" {:.4f}\n", defocus.phase_shift_deg) : "\n";
  }
  write_text_file(path, text);
}

}  // namespace tomofield::io
