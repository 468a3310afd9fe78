#include "cli/options/number_checks.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <system_error>

#include "io/tables/text_lines.h"

namespace tomofield::cli {
namespace {

// Returns a check that accepts a finite number if `holds` is true for it. `wanted` describes these
// numbers.
template <typename Holds>
CLI::Validator number_that(std::string wanted, Holds holds) {
  return {[wanted, holds](std::string& text) -> std::string {
            char* end = nullptr;
            const double value = std::strtod(text.c_str(), &end);
            const bool is_number = end != text.c_str() && *end == '\0' && std::isfinite(value);
            if (is_number && holds(value)) return {};
            return fmt::format("must be a number {}, not {}", wanted, text);
          },
          ""};
}

}  // namespace

std::optional<std::vector<long long>> parse_whole_numbers(const std::string& text) {
  std::vector<long long> values;
  for (const std::string& word : CLI::detail::split(text, ',')) {
    const std::optional<long long> value = io::parse_integer(word);
    if (!value) return std::nullopt;
    values.push_back(*value);
  }
  return values;
}

CLI::Validator number_above(double low) {
  return number_that(fmt::format("above {:g}", low), [low](double value) { return value > low; });
}

CLI::Validator number_between(double low, double high) {
  return number_that(fmt::format("from {:.10g} to {:.10g}", low, high),
                     [low, high](double value) { return value >= low && value <= high; });
}

CLI::Validator seed_check() {
  return {[](std::string& text) -> std::string {
            std::uint64_t seed = 0;
            const char* const end = text.data() + text.size();
            const auto [next, fault] = std::from_chars(text.data(), end, seed);
            const bool is_seed = fault == std::errc() && next == end;
            return is_seed ? ""
                           : fmt::format("must be a whole number from 0 to 2^64 - 1, not {}", text);
          },
          ""};
}

}  // namespace tomofield::cli
