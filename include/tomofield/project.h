#pragma once

#include <tomofield/options.h>

#include <filesystem>
#include <string>
#include <vector>

namespace tomofield {

/// A tilt series as another program describes it: eTomo, AreTomo, RELION 5, Warp or SerialEM.
/// Values of `options` that its files set have the origin kProject, and Options::settings list them
/// with file and entry. The user's own wishes go over them.
struct Project {
  SeriesFiles files;
  Options options;
  std::vector<std::string> warnings;  ///< of what the result does not show by itself
};

/// A project to be read, and the wishes of the user for reading it.
struct ProjectRequest {
  std::filesystem::path path;  ///< of its main file or its folder, or of a stack alone
  std::string series = {};     ///< the name of one series of a project that has several
  std::string ignore = {};     ///< entries that are not applied: "LOCALFILE,LOG"
};

/// Reads a project, as `tomofield reconstruct PATH` does. The path of a stack gives the stack
/// alone. Throws Error for a folder without a project or with several, and for a project that
/// cannot be honoured.
Project open_project(const ProjectRequest& request);

}  // namespace tomofield
