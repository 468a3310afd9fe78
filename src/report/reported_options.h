#pragma once

#include <string>
#include <vector>

#include "tomofield/options.h"

namespace tomofield::report {

/// An option of a run as its report shows it.
struct ReportedOption {
  std::string flag, value;
  std::string origin;   ///< where the value comes from
  std::string meaning;  ///< what it is
  bool is_default = false;
};

/// Returns every option that decides what a run makes, in the order of the help. The origin is the
/// file that Options::settings name for the option, else the one that its Choice has. Settings that
/// name no option follow.
std::vector<ReportedOption> reported_options(const SeriesFiles& files, const Options& options);

}  // namespace tomofield::report
