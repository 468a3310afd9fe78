#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

namespace tomofield::cli {

/// Return checks of one number on the command line. Unlike CLI11's own they refuse NaN, and they
/// say in a few words which numbers are valid.
CLI::Validator number_above(double low);
CLI::Validator number_between(double low, double high);
/// Parses whole numbers with commas between them, in one word of the command line. Returns nothing
/// if one of the numbers cannot be parsed.
std::optional<std::vector<long long>> parse_whole_numbers(const std::string& text);
/// Returns a check of a seed. Without it, CLI11 takes -1 for the largest unsigned number.
CLI::Validator seed_check();

}  // namespace tomofield::cli
