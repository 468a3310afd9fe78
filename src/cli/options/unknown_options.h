#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace tomofield::cli {

/// Returns a sentence on the words of a command line that the called command does not know, in
/// their order: on unknown options with the known one that is nearest, or else on words that belong
/// to no option. Returns an empty text if there are none. `command` has parsed the arguments, and
/// may have thrown.
std::string fault_of_unknown_words(const CLI::App& command,
                                   const std::vector<std::string>& arguments);

}  // namespace tomofield::cli
