#pragma once

#include <CLI/CLI.hpp>

namespace tomofield::cli {

/// Checks of one number on the command line. Unlike CLI11's own they refuse NaN,
/// and say in a few words what is wanted.
CLI::Validator number_above(double low);
CLI::Validator number_between(double low, double high);
/// CLI11 takes -1 for the largest unsigned number.
CLI::Validator seed_check();

}  // namespace tomofield::cli
