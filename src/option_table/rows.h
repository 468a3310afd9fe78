#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>

#include "base/enum_names.h"
#include "tomofield/options.h"

namespace tomofield::option_table {

/// The values that a number may take. NaN and infinity are in no range but kAny, and numbers beyond
/// base::kLargestNumber are in none that has no upper limit of its own.
struct Range {
  enum class Kind { kAny, kBetween, kZeroOrBetween, kAbove, kAtLeast, kMultiple, kEither };
  Kind kind = Kind::kAny;
  double low = 0, high = 0;

  static constexpr Range between(double low, double high) { return {Kind::kBetween, low, high}; }
  /// 0 switches something off; other values lie between the limits.
  static constexpr Range zero_or_between(double low, double high) {
    return {Kind::kZeroOrBetween, low, high};
  }
  static constexpr Range above(double low) { return {Kind::kAbove, low, 0}; }
  static constexpr Range at_least(double low) { return {Kind::kAtLeast, low, 0}; }
  static constexpr Range multiple_of(double step, double high) {
    return {Kind::kMultiple, step, high};
  }
  static constexpr Range either(double first, double second) {
    return {Kind::kEither, first, second};
  }

  bool contains(double value) const;
  /// Tells whether the range itself ends, and not with the largest number of all options.
  constexpr bool has_upper_limit() const {
    return kind != Kind::kAny && kind != Kind::kAbove && kind != Kind::kAtLeast;
  }
  /// Returns the end of the sentence "it must be …": "from 1 to 256".
  std::string text() const;
};

/// Orders the options in the help and in docs/options.md.
enum class Group {
  kSeries,
  kAlignment,
  kImages,
  kMasks,
  kTransfer,
  kSpecimen,
  kField,
  kFit,
  kVolume,
  kHalves,
  kRun,
  kResearch  ///< the method's own settings, which nobody needs to turn
};
std::string_view title_of(Group group);

/// The values of all options.
struct Choices {
  SeriesFiles files;
  Options options;
};

/// Returns the value of an option. A Choice that is open, and an std::optional without a value, are
/// chosen automatically.
template <typename T>
using Reference = T& (*)(Choices&);
template <typename... T>
using References = std::variant<Reference<T>...>;
using Member = References<std::filesystem::path, std::optional<std::filesystem::path>, bool, int,
                          std::int64_t, std::uint64_t, double, std::string, std::optional<int>,
                          std::optional<double>, std::optional<Rectangle>, Contrast, Alignment,
                          TreeKind, Engine, RingReference, NoiseModel, VoxelType, VolumeAxes,
                          ZarrVersion, Choice<bool>, Choice<int>, Choice<double>, Choice<FieldKind>,
                          Choice<Activation>, Choice<Penalty>, Choice<Prior>>;

/// Describes one option: the command line, the configuration file, the checks, the JSON, the
/// fingerprint of a checkpoint and docs/options.md all read this row.
struct Row {
  std::string_view key;   ///< path in the JSON, as in "fit.epochs"
  std::string_view flag;  ///< "--epochs", "-o,--output", or "stack" for the positional argument;
                          ///< neighbours with one flag share it and are written as a list
  Member member;
  std::string_view section;  ///< the struct that has the member: "files", "options.fit"
  std::string_view name;     ///< in Python; in C++ it is the member but for FieldOptions::kind
  Group group = Group::kSeries;
  std::string_view label = {};  ///< stands for the value in the help; empty: by the type
  std::string_view unit = {};
  Range range = {};
  std::string_view automatic = {};  ///< says what is chosen where no value is given
  std::string_view help;
  bool is_common = false;       ///< shown by --help; --help-all shows all options
  bool is_required = false;     ///< a run refuses to do without
  bool is_of_project = false;   ///< a project may state what is required
  std::string_view rival = {};  ///< key of the option that a user gives in place of this one
};

/// Returns the name of an enum's value in Python: that of the command line, but for voxel types,
/// which are named as numpy names them.
template <typename Enum>
std::string python_name_of(Enum value) {
  if constexpr (std::is_same_v<Enum, VoxelType>) {
    switch (value) {
      case VoxelType::kFloat32:
        return "float32";
      case VoxelType::kFloat16:
        return "float16";
      case VoxelType::kInt16:
        return "int16";
    }
  }
  return base::name_of(value);
}

/// Returns true if somebody chose the value of an option that may be chosen automatically.
template <typename T>
bool is_chosen(const std::optional<T>& value) {
  return value.has_value();
}
template <typename T>
bool is_chosen(const Choice<T>& value) {
  return !value.is_open();
}

/// Returns every option, one row a member of SeriesFiles and of the sections of Options, ordered by
/// group.
std::span<const Row> all_rows();

/// Returns the row with this key. The key must be in the table.
const Row& row_of(std::string_view key);

/// Returns the rows with this flag, which is written as in the table: "-o,--output". Several rows
/// share one whose value is a list, as --center does.
std::span<const Row> rows_of_flag(std::string_view flag);

/// Returns the flag that users type for a key of the JSON, or an empty text for an unknown key.
std::string_view flag_of(std::string_view key);

/// Calls `visit` with a reference to the value of an option and returns its result.
template <typename Visit>
decltype(auto) visit_value(const Row& row, Choices& choices, Visit&& visit) {
  return std::visit([&](auto reference) -> decltype(auto) { return visit(reference(choices)); },
                    row.member);
}
template <typename Visit>
decltype(auto) visit_value(const Row& row, const Choices& choices, Visit&& visit) {
  return std::visit(
      [&](auto reference) -> decltype(auto) {
        return visit(std::as_const(reference(const_cast<Choices&>(choices))));
      },
      row.member);
}

}  // namespace tomofield::option_table
