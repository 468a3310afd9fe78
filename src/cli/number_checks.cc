#include "cli/number_checks.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <string>

namespace tomofield::cli {
namespace {

// `holds` tells whether a finite number will do, `wanted` describes those that do.
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

CLI::Validator number_above(double low) {
  return number_that(fmt::format("above {:g}", low), [low](double value) { return value > low; });
}

CLI::Validator number_between(double low, double high) {
  return number_that(fmt::format("from {:g} to {:g}", low, high),
                     [low, high](double value) { return value >= low && value <= high; });
}

CLI::Validator seed_check() {
  return {[](std::string& text) -> std::string {
            const bool is_seed = !text.empty() && text.find_first_not_of("0123456789") == text.npos;
            return is_seed ? "" : fmt::format("must be a whole number from 0, not {}", text);
          },
          ""};
}

}  // namespace tomofield::cli
