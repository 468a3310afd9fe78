#pragma once

#include <string>
#include <vector>

namespace tomofield::compare {

/// A method of reconstruction: the command that a comparison runs and its names in the report.
struct Method {
  std::string name;   ///< also the name of its files
  std::string title;  ///< its name in the report
  std::vector<std::string>
      arguments;  ///< words of tomofield before the series: command and options
  /// The same words with those of a configuration file in the place of --config. They name files
  /// that the method reads. Empty if the method has no --config.
  std::vector<std::string> expanded = {};
  bool resumes = false;  ///< true if --resume continues an interrupted run
  bool tunes = false;    ///< true if --tune chooses its weights
};

/// Returns the methods that have a name.
const std::vector<Method>& known_methods();

/// Returns the names of methods, in order.
std::vector<std::string> names_of(const std::vector<Method>& methods);

/// Returns the methods of a comparison, in order: the known ones in `names`, then `others`, each as
/// NAME=COMMAND with the words of a tomofield command, such as "smooth=reconstruct --tv-penalty
/// smooth". Throws Error for unknown names, for names that are there twice, cannot name a file or
/// are names of the comparison's own files, and for commands that make no tomogram.
std::vector<Method> choose_methods(const std::vector<std::string>& names,
                                   const std::vector<std::string>& others);

}  // namespace tomofield::compare
