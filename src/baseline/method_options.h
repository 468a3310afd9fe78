#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "baseline/run_baseline.h"
#include "option_table/rows.h"

namespace tomofield::baseline {

/// Describes an option that is a method's own, or that all baselines have beside those of the
/// option table. The command line, C++ and Python read it.
struct MethodOption {
  template <typename T>
  using Reference = T& (*)(BaselineOptions&);
  using Member = std::variant<Reference<int>, Reference<double>, Reference<std::uint64_t>,
                              Reference<std::optional<bool>>, Reference<std::optional<double>>,
                              Reference<std::optional<Penalty>>, Reference<RampWindow>,
                              Reference<microscope::CtfCorrection>>;
  std::string_view flag;  ///< "--tv-steps"
  Member member;
  std::string_view help;
  option_table::Range range = {};
  std::string_view automatic = {};    ///< says what holds where no value is given
  std::string_view group = "Method";  ///< title in the help
};

/// The options of the table, by their keys, that every method has beside those of whole groups.
inline constexpr std::array<std::string_view, 3> kSharedFitKeys{
    "fit.fit_view_scale", "field.margin_spacing", "fit.hold_out"};
inline constexpr std::array<std::string_view, 2> kRunKeys{"running.output", "running.overwrite"};

/// Says whether a method takes an option of the table.
bool takes_option(const Method& method, const option_table::Row& row);

/// The words of the help for --non-negative, which `tensorf` has as well.
inline constexpr std::string_view kNonNegativeHelp =
    "Keep densities at or above zero: with dark contrast nothing is brighter than the empty beam";
inline constexpr std::string_view kNonNegativeDefault =
    "off for dark contrast, whose zero is uncertain, else on";

/// Returns the method with the name that the command line has for it, with its usual options;
/// nothing for another name.
std::optional<Method> method_named(std::string_view name);

/// Returns the options of a method, in the order of the help.
std::vector<MethodOption> options_of(const Method& method);

/// The kind of value that an option takes.
enum class ValueKind { kSwitch, kWholeNumber, kNumber, kWord };
ValueKind kind_of(const MethodOption& option);
/// Says whether an option may be left open, which is the word "auto".
bool may_be_open(const MethodOption& option);

/// Sets an option to what a text says: "80", "concave", "on" or "off"; "auto" for one that may be
/// left open. Returns what the text must be if it is none of these, else an empty text.
std::string set_from_text(const MethodOption& option, std::string_view text,
                          BaselineOptions& options);

/// Returns what an option is without being given, for the help.
std::string default_text(const MethodOption& option, BaselineOptions options);

/// Returns what stands for its value in the help: "N", "ramp|cosine|hann".
std::string label_of(const MethodOption& option);

/// Sets options by their names without dashes: {"tv-steps", "20"}. Throws Error for a name that the
/// method has not, and for a value that cannot be.
void set_options(const std::map<std::string, std::string>& given, BaselineOptions& options);

}  // namespace tomofield::baseline
