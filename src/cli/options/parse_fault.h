#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace tomofield::cli {

/// Returns a sentence on what is wrong with the arguments of the called command, whose parsing
/// threw `error`. The first of these that applies:
///
/// - unknown options, each with known ones that are alike, or else words that belong to no option;
/// - a stack that does not exist, before options that only a stack needs;
/// - an option that is given twice;
/// - what `error` says, with the option as the user spelt it.
std::string parse_fault(const CLI::App& command, const std::vector<std::string>& arguments,
                        const CLI::ParseError& error);

}  // namespace tomofield::cli
