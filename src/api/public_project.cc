#include <fmt/format.h>

#include <optional>
#include <string>

#include "base/threads/parallel.h"
#include "option_table/setting.h"
#include "option_table/values.h"
#include "projects/project.h"
#include "tomofield/error.h"
#include "tomofield/project.h"

namespace tomofield {

Project open_project(const ProjectRequest& request) {
  const base::ThreadsInUse threads;
  std::error_code unknown;
  if (!std::filesystem::exists(request.path, unknown))
    throw Error(fmt::format("there is no '{}': give a project, its folder or a stack",
                            request.path.string()));
  option_table::Choices choices;
  choices.files.stack = request.path;
  choices.options.views.ignore = request.ignore;
  const std::optional<projects::Project> project =
      projects::read_project({.path = request.path,
                              .ignored = option_table::split_names(request.ignore),
                              .series = request.series});
  if (!project) return {choices.files, choices.options, {}};
  option_table::apply_settings(project->settings(), choices);
  return {choices.files, choices.options, project->warnings()};
}

}  // namespace tomofield
