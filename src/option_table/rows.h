#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <variant>

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
  kRun
};
std::string_view title_of(Group group);

/// Points to the value of an option. An std::optional without a value is chosen automatically.
using Member = std::variant<
    std::filesystem::path SeriesFiles::*, std::optional<std::filesystem::path> SeriesFiles::*,
    bool Options::*, int Options::*, std::int64_t Options::*, std::uint64_t Options::*,
    double Options::*, std::string Options::*, std::filesystem::path Options::*,
    std::optional<bool> Options::*, std::optional<int> Options::*, std::optional<double> Options::*,
    std::optional<Rectangle> Options::*, Contrast Options::*, Alignment Options::*,
    std::optional<FieldKind> Options::*, TreeKind Options::*, std::optional<Activation> Options::*,
    Engine Options::*, std::optional<Penalty> Options::*, std::optional<Prior> Options::*,
    RingReference Options::*, NoiseModel Options::*, VoxelType Options::*, VolumeAxes Options::*>;

/// Describes one option: the command line, the configuration file, the checks, the JSON, the
/// fingerprint of a checkpoint and docs/options.md all read this row.
struct Row {
  std::string_view key;   ///< path in the JSON, as in "fit.epochs"
  std::string_view flag;  ///< "--epochs", "-o,--output", or "stack" for the positional argument;
                          ///< neighbours with one flag share it and are written as a list
  Member member;
  std::string_view name;  ///< of the member, in C++ and Python
  Group group = Group::kSeries;
  std::string_view label = {};  ///< stands for the value in the help; empty: by the type
  std::string_view unit = {};
  Range range = {};
  std::string_view automatic = {};  ///< says what is chosen where no value is given
  std::string_view help;
  bool is_common = false;    ///< shown by --help; --help-all shows all options
  bool is_required = false;  ///< the command line refuses to do without
};

/// Returns every option, one row a member of SeriesFiles and Options, ordered by group.
std::span<const Row> all_rows();

/// Returns the row with this key. The key must be in the table.
const Row& row_of(std::string_view key);

/// Returns the flag that users type for a key of the JSON, or an empty text for an unknown key.
std::string_view flag_of(std::string_view key);

/// Calls `visit` with a reference to the value of an option and returns its result.
template <typename Files, typename Values, typename Visit>
decltype(auto) visit_value(const Row& row, Files& files, Values& options, Visit&& visit) {
  return std::visit(
      [&]<typename T, typename Struct>(T Struct::*member) -> decltype(auto) {
        if constexpr (std::is_same_v<Struct, SeriesFiles>)
          return visit(files.*member);
        else
          return visit(options.*member);
      },
      row.member);
}

}  // namespace tomofield::option_table
