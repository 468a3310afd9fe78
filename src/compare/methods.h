#pragma once

#include <string>
#include <vector>

namespace tomofield::compare {

/// One way to reconstruct: what a comparison runs and how its report calls it.
struct Method {
  std::string name;   ///< also of its files
  std::string title;  ///< for people
  std::vector<std::string>
      arguments;         ///< of tomofield, before the series: the command, its options
  bool resumes = false;  ///< whether an interrupted run goes on with --resume
  bool tunes = false;    ///< whether --tune chooses its weights
};

/// The methods that have a name.
const std::vector<Method>& known_methods();

/// In order.
std::vector<std::string> names_of(const std::vector<Method>& methods);

/// The methods of a comparison, in order: `names` of known ones, then `others`, each
/// NAME=COMMAND with the words of a tomofield command, as in
/// "smooth=reconstruct --tv-penalty smooth". Throws Error for unknown names, for names that
/// are there twice, cannot name a file or are those of the comparison's own files, and for commands
/// that make no tomogram.
std::vector<Method> choose_methods(const std::vector<std::string>& names,
                                   const std::vector<std::string>& others);

}  // namespace tomofield::compare
