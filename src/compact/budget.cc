#include "compact/budget.h"

#include <fmt/format.h>
#include <strings.h>

#include <cmath>
#include <cstdlib>
#include <map>

#include "tomofield/error.h"

namespace tomofield::compact {
namespace {

struct Unit {
  Budget::Kind kind;
  double factor, low, high;  // the range is that of the number before the unit times the factor
};

const std::map<std::string, Unit>& units() {
  using Kind = Budget::Kind;
  static const std::map<std::string, Unit> all{{"dB", {Kind::kDecibels, 1, 0.001, kMostDecibels}},
                                               {"", {Kind::kParameters, 1, 1, 1e12}},
                                               {"k", {Kind::kParameters, 1e3, 1, 1e12}},
                                               {"M", {Kind::kParameters, 1e6, 1, 1e12}},
                                               {"kB", {Kind::kBytes, 1e3, 1000, 1e15}},
                                               {"MB", {Kind::kBytes, 1e6, 1000, 1e15}}};
  return all;
}

// Returns a unit of decibels or bytes as it is usually written, whatever its case is.
std::string with_usual_case(const std::string& unit) {
  for (const char* usual : {"dB", "kB", "MB"})
    if (strcasecmp(unit.c_str(), usual) == 0) return usual;
  return unit;
}

}  // namespace

Budget parse_budget(const std::string& text) {
  char* end = nullptr;
  const double number = std::strtod(text.c_str(), &end);
  const auto unit = units().find(with_usual_case(end));
  const bool is_number = end != text.c_str() && std::isfinite(number);
  if (is_number && unit != units().end()) {
    const double amount = number * unit->second.factor;
    if (amount >= unit->second.low && amount <= unit->second.high)
      return {unit->second.kind, amount};
  }
  throw Error(fmt::format(
      "'{}' is no budget: give decibels from 0.001dB to {}dB, parameters such as 500k or 2M, or a "
      "size of 1kB or more such as 5MB",
      text, kMostDecibels));
}

}  // namespace tomofield::compact
