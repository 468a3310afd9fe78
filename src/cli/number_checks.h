#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

namespace tomofield::cli {

/// Checks of one number on the command line. Unlike CLI11's own they refuse NaN,
/// and say in a few words what is wanted.
CLI::Validator number_above(double low);
CLI::Validator number_between(double low, double high);
/// Numbers with commas between, as one word of the command line (as several words they would take
/// those after them); none if one of them cannot be parsed.
std::optional<std::vector<double>> parse_numbers(const std::string& text);
std::optional<std::vector<long long>> parse_whole_numbers(const std::string& text);
/// CLI11 takes -1 for the largest unsigned number.
CLI::Validator seed_check();

}  // namespace tomofield::cli
