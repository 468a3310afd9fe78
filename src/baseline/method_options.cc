#include "baseline/method_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <type_traits>

#include "base/enum_names.h"
#include "base/nearest_names.h"
#include "baseline/tune.h"
#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::baseline {
namespace {

using option_table::Range;

template <typename M>
M& of(BaselineOptions& options) {
  return std::get<M>(options.method);
}

// ------------------------------------------------------------------- rows

MethodOption ctf_correction_row() {
  return {
      .flag = "--ctf-correction",
      .member = [](BaselineOptions& o) -> microscope::CtfCorrection& { return o.ctf_correction; },
      .help =
          "What takes the contrast transfer of --ctf or --defocus back before the "
          "reconstruction, each place of a view with its own defocus: flip its phases, "
          "multiply by it, or Wiener's filter",
      .group = option_table::title_of(option_table::Group::kTransfer)};
}

template <typename M>
MethodOption iterations_row() {
  return {.flag = "--iterations",
          .member = [](BaselineOptions& o) -> int& { return of<M>(o).iterations; },
          .help = "Passes over all views",
          .range = Range::above(0)};
}

MethodOption non_negative_row() {
  return {.flag = "--non-negative",
          .member = [](BaselineOptions& o) -> std::optional<bool>& { return o.non_negative; },
          .help = kNonNegativeHelp,
          .automatic = kNonNegativeDefault};
}

template <typename M>
MethodOption relaxation_row(std::string_view help) {
  return {.flag = "--relaxation",
          .member = [](BaselineOptions& o) -> double& { return of<M>(o).relaxation; },
          .help = help,
          .range = Range::between(0.01, 1.99)};
}

std::vector<MethodOption> rows_of(const WbpOptions&) {
  return {
      {.flag = "--window",
       .member = [](BaselineOptions& o) -> RampWindow& { return of<WbpOptions>(o).filter.window; },
       .help = "Window that multiplies the ramp; ramp: none"},
      {.flag = "--cutoff",
       .member = [](BaselineOptions& o) -> double& { return of<WbpOptions>(o).filter.cutoff; },
       .help = "Frequency up to which the ramp rises, in cycles a pixel. 0.5: all frequencies",
       .range = Range::between(0.01, 0.5)},
      {.flag = "--falloff",
       .member = [](BaselineOptions& o) -> double& { return of<WbpOptions>(o).filter.falloff; },
       .help = "Sigma of the Gaussian by which it falls beyond, in cycles a pixel",
       .range = Range::between(0.001, 0.5)}};
}

std::vector<MethodOption> rows_of(const SirtOptions&) {
  return {relaxation_row<SirtOptions>("Length of a step, between 0 and 2")};
}

std::vector<MethodOption> rows_of(const SartTvOptions&) {
  return {{.flag = "--subsets",
           .member = [](BaselineOptions& o) -> int& { return of<SartTvOptions>(o).subsets; },
           .help = "Interleaved subsets of the views in a pass",
           .range = Range::above(0)},
          relaxation_row<SartTvOptions>(
              "Length of a subset's step in the first pass, between 0 and 2; it decays"),
          {.flag = "--tv-steps",
           .member = [](BaselineOptions& o) -> int& { return of<SartTvOptions>(o).tv_steps; },
           .help = "Number of steps down the total variation after each pass",
           .range = Range::above(0)},
          {.flag = "--weight",
           .member = [](BaselineOptions& o) -> double& { return of<SartTvOptions>(o).weight; },
           .help = "Length of these steps together, in units of the change that the pass made",
           .range = Range::above(0)}};
}

std::vector<MethodOption> rows_of(const TvOptions&) {
  return {
      {.flag = "--weight",
       .member = [](BaselineOptions& o) -> std::optional<double>& {
         return of<TvOptions>(o).weight;
       },
       .help = "Weight of the total variation, in noise units: the objective is half the sum of "
               "squared residuals over the noise's variance, plus this times the sum of the "
               "density's gradients",
       .range = Range::above(0),
       .automatic = "3; 8 if concave"},
      {.flag = "--penalty",
       .member = [](BaselineOptions& o) -> std::optional<Penalty>& {
         return of<TvOptions>(o).penalty;
       },
       .help = "Kind of total variation: smooth is the usual one, concave spares edges by "
               "reweighting",
       .automatic = "smooth; with --tune the one that predicts held-out views better"}};
}

template <typename M>
std::vector<MethodOption> network_rows() {
  return {{.flag = "--hidden-layers",
           .member = [](BaselineOptions& o) -> int& { return of<M>(o).hidden_layers; },
           .help = "Layers of neurons between the features of a position and its density",
           .range = Range::between(1, 16)},
          {.flag = "--width",
           .member = [](BaselineOptions& o) -> int& { return of<M>(o).width; },
           .help = "Neurons of a hidden layer",
           .range = Range::between(1, 1024)},
          {.flag = "--learning-rate",
           .member = [](BaselineOptions& o) -> double& { return of<M>(o).learning_rate; },
           .help = "Learning rate of the first step; it decays to a tenth",
           .range = Range::above(0)},
          {.flag = "--seed",
           .member = [](BaselineOptions& o) -> std::uint64_t& { return of<M>(o).seed; },
           .help = "Seed of all random numbers"}};
}

std::vector<MethodOption> rows_of(const IngpOptions&) {
  constexpr Range kDistances = Range::between(0.25, 1024);
  std::vector<MethodOption> rows = network_rows<IngpOptions>();
  rows.insert(
      rows.end(),
      {{.flag = "--levels",
        .member = [](BaselineOptions& o) -> int& { return of<IngpOptions>(o).grid.levels; },
        .help = "Number of grids, from coarse to fine",
        .range = Range::between(1, 32)},
       {.flag = "--coarsest",
        .member = [](BaselineOptions& o) -> double& { return of<IngpOptions>(o).grid.coarsest; },
        .help = "Distance between vertices of the coarsest level, in binned pixels",
        .range = kDistances},
       {.flag = "--finest",
        .member = [](BaselineOptions& o) -> double& { return of<IngpOptions>(o).grid.finest; },
        .help = "Distance between vertices of the finest level, in binned pixels",
        .range = kDistances},
       {.flag = "--table-bits",
        .member = [](BaselineOptions& o) -> int& { return of<IngpOptions>(o).grid.table_bits; },
        .help =
            "Binary logarithm of the most vertices that a level stores. Where it has more, they "
            "share entries by a hash",
        .range = Range::between(4, 28)}});
  return rows;
}

std::vector<MethodOption> rows_of(const FourierNetOptions&) {
  std::vector<MethodOption> rows = network_rows<FourierNetOptions>();
  rows.insert(
      rows.end(),
      {{.flag = "--features",
        .member = [](BaselineOptions& o) -> int& { return of<FourierNetOptions>(o).features; },
        .help = "Plane waves of random direction: the features of a position",
        .range = Range::between(1, 4096)},
       {.flag = "--shortest",
        .member = [](BaselineOptions& o) -> double& { return of<FourierNetOptions>(o).shortest; },
        .help = "Shortest wavelength of the plane waves, in binned pixels",
        .range = Range::between(1, 1024)}});
  return rows;
}

// ------------------------------------------------------------------ values

// The type of a value, without the std::optional around it.
template <typename T>
struct Value {
  using type = T;
  static constexpr bool kMayBeOpen = false;
};
template <typename T>
struct Value<std::optional<T>> {
  using type = T;
  static constexpr bool kMayBeOpen = true;
};

template <typename Enum>
std::string names_of(const char* separator) {
  std::vector<std::string> names;
  for (const auto& [_, name] : base::EnumNames<Enum>::kNames) names.emplace_back(name);
  return fmt::format("{}", fmt::join(names, separator));
}

template <typename Number>
std::optional<Number> read_number(std::string_view text) {
  if constexpr (std::is_integral_v<Number>) {
    Number number{};
    const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), number);
    const bool is_whole = fault == std::errc() && end == text.data() + text.size();
    return is_whole ? std::optional(number) : std::nullopt;
  } else {
    const auto number = io::parse_number(text);
    return number ? std::optional(static_cast<Number>(*number)) : std::nullopt;
  }
}

// Sets `target` to a number within a range. Returns what the text must be otherwise.
template <typename Number, typename Target>
std::string set_number(std::string_view text, const Range& range, Target& target) {
  const std::optional<Number> number = read_number<Number>(text);
  if (number && range.contains(static_cast<double>(*number))) {
    target = *number;
    return {};
  }
  const char* const kind = std::is_integral_v<Number> ? "a whole number" : "a number";
  if (std::is_unsigned_v<Number>) return fmt::format("{} from 0", kind);
  return fmt::format("{} {}", kind, range.text());
}

// Sets `target` to what a text says. Returns what the text must be otherwise.
template <typename V, typename Target>
std::string set_value(std::string_view text, const Range& range, Target& target) {
  if constexpr (std::is_same_v<V, bool>) {
    if (text != "on" && text != "off") return "on or off";
    target = text == "on";
  } else if constexpr (std::is_enum_v<V>) {
    const auto found = base::enum_named<V>(text);
    if (!found) return names_of<V>(" or ");
    target = *found;
  } else {
    return set_number<V>(text, range, target);
  }
  return {};
}

[[noreturn]] void refuse_name(const std::string& name, const char* method,
                              const std::vector<MethodOption>& known) {
  std::vector<std::string> names;
  for (const MethodOption& option : known) names.emplace_back(option.flag.substr(2));
  throw Error(fmt::format("the method {} has no option '{}'{}; it has {}", method, name,
                          base::did_you_mean(base::nearest_names(name, names)),
                          fmt::join(names, ", ")));
}

}  // namespace

std::optional<Method> method_named(std::string_view name) {
  for (const Method& method :
       {Method(WbpOptions{}), Method(SirtOptions{}), Method(SartTvOptions{}), Method(TvOptions{}),
        Method(IngpOptions{}), Method(FourierNetOptions{})})
    if (facts_of(method).name == name) return method;
  return std::nullopt;
}

std::vector<MethodOption> options_of(const Method& method) {
  return std::visit(
      []<typename M>(const M& own) {
        std::vector<MethodOption> rows{ctf_correction_row()};
        if constexpr (requires { own.iterations; }) rows.push_back(iterations_row<M>());
        if constexpr (requires { own.non_negative; }) rows.push_back(non_negative_row());
        for (const MethodOption& row : rows_of(own)) rows.push_back(row);
        return rows;
      },
      method);
}

bool takes_option(const Method& method, const option_table::Row& row) {
  using option_table::Group;
  const auto has = [&](const auto& list, const auto& wanted) {
    return std::ranges::find(list, wanted) != list.end();
  };
  constexpr std::array kGroups{Group::kSeries,   Group::kAlignment, Group::kImages, Group::kMasks,
                               Group::kTransfer, Group::kSpecimen,  Group::kVolume};
  return has(kGroups, row.group) || has(kSharedFitKeys, row.key) || has(kRunKeys, row.key) ||
         (row.key == "tune" && is_tunable(method));
}

ValueKind kind_of(const MethodOption& option) {
  return std::visit(
      []<typename T>(MethodOption::Reference<T>) {
        using V = typename Value<T>::type;
        if constexpr (std::is_same_v<V, bool>)
          return ValueKind::kSwitch;
        else if constexpr (std::is_enum_v<V>)
          return ValueKind::kWord;
        else
          return std::is_integral_v<V> ? ValueKind::kWholeNumber : ValueKind::kNumber;
      },
      option.member);
}

bool may_be_open(const MethodOption& option) {
  return std::visit([]<typename T>(MethodOption::Reference<T>) { return Value<T>::kMayBeOpen; },
                    option.member);
}

std::string set_from_text(const MethodOption& option, std::string_view text,
                          BaselineOptions& options) {
  return std::visit(
      [&]<typename T>(MethodOption::Reference<T> member) -> std::string {
        using V = typename Value<T>::type;
        if constexpr (Value<T>::kMayBeOpen) {
          if (text == "auto") {
            member(options) = std::nullopt;
            return {};
          }
        }
        std::string wanted = set_value<V>(text, option.range, member(options));
        if (Value<T>::kMayBeOpen && !wanted.empty())
          wanted.insert(0, std::is_same_v<V, bool> ? "auto, " : "auto or ");
        return wanted;
      },
      option.member);
}

std::string default_text(const MethodOption& option, BaselineOptions options) {
  if (!option.automatic.empty()) return std::string(option.automatic);
  return std::visit(
      [&]<typename T>(MethodOption::Reference<T> member) -> std::string {
        if constexpr (std::is_enum_v<T>)
          return base::name_of(member(options));
        else if constexpr (std::is_arithmetic_v<T>)
          return fmt::format("{}", member(options));
        else
          return {};
      },
      option.member);
}

std::string label_of(const MethodOption& option) {
  return std::visit(
      []<typename T>(MethodOption::Reference<T>) -> std::string {
        using V = typename Value<T>::type;
        if constexpr (std::is_same_v<V, bool>)
          return "auto|on|off";
        else if constexpr (std::is_enum_v<V>)
          return names_of<V>("|");
        else
          return std::is_integral_v<V> ? "N" : "NUMBER";
      },
      option.member);
}

void set_options(const std::map<std::string, std::string>& given, BaselineOptions& options) {
  const std::vector<MethodOption> known = options_of(options.method);
  for (const auto& [name, text] : given) {
    const auto option = std::ranges::find(known, "--" + name, &MethodOption::flag);
    if (option == known.end()) refuse_name(name, facts_of(options.method).name, known);
    const std::string wanted = set_from_text(*option, text, options);
    if (!wanted.empty())
      throw Error(fmt::format("{} must be {}, not '{}'", option->flag, wanted, text));
  }
}

}  // namespace tomofield::baseline
