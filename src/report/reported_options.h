#pragma once

#include <nlohmann/json.hpp>
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

/// Returns every option that decides what a run makes, in the order of the help. `record` is the
/// content of its JSON file, `files` and `requested` are what the user asked for.
///
/// The origin is the file that the record's "origins" name for the option ([{"option", "value",
/// "file", "entry"}]). Otherwise it is "given" if the request differs from the default, "chosen by
/// trials" or "chosen automatically" if the run chose it, and else "default". Entries of "origins"
/// that name no option follow.
std::vector<ReportedOption> reported_options(const nlohmann::json& record, const SeriesFiles& files,
                                             const Options& requested);

}  // namespace tomofield::report
