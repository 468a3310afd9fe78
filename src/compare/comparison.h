#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "compare/rows.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::compare {

struct CompareOptions {
  std::filesystem::path program;  ///< tomofield itself
  tilt_series::TiltSeriesOptions input;
  std::vector<std::string> series_words;       ///< of the command line, without --exclude
  std::vector<Method> methods;                 ///< the first is the main one
  std::optional<std::filesystem::path> truth;  ///< MRC volume
  bool tune = false;                           ///< --tune for methods that know it
  bool halves = false;  ///< run on odd and even views as well, for the correlation of the two
  int hold_out = 0;     ///< run without every so-manieth view as well, 0: not
  std::filesystem::path folder;
  bool overwrite = false;
};

/// Throws Error for what would stop a comparison later: no method, no such series or truth, a
/// folder that cannot be made.
void check_comparison(const CompareOptions& options);

/// Runs what has not been run yet (run_rows), scores every volume and writes into the folder
/// comparison.json, comparison.csv, report.html (report/html.h: one file, no network) and the
/// pictures that are in it.
RowsOutcome compare_methods(const CompareOptions& options, const RunHooks& hooks);

}  // namespace tomofield::compare
