#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "compare/rows.h"
#include "evaluate/contrast.h"
#include "evaluate/profile.h"
#include "tomofield/options.h"

namespace tomofield::compare {

struct CompareOptions {
  std::filesystem::path program;  ///< tomofield itself
  SeriesFiles files;
  Options series;                         ///< says how the series is read and where the specimen is
  std::vector<std::string> series_words;  ///< words of the command line, without --exclude
  std::vector<Method> methods;            ///< the first is the main one
  std::optional<std::filesystem::path> truth;  ///< MRC volume
  bool tune = false;                           ///< give --tune to the methods that have it
  bool halves = false;        ///< also run on the odd and on the even views and correlate the two
  int hold_out = 0;           ///< also run without every Nth view; 0: do not
  evaluate::Regions regions;  ///< where contrast is measured; empty: chosen on one of the volumes
  std::optional<evaluate::LineSegment> profile;  ///< default: along x through the detail
  std::filesystem::path folder;
  bool overwrite = false;
};

/// Checks the options. Throws Error if there is no method, or if the series or the truth does not
/// exist.
void check_comparison(const CompareOptions& options);

enum class Outcome { kFinished, kStopped, kStoppedBeforeRuns };

/// Runs a comparison. First it checks what would stop it later (rehearse). Then it makes the
/// folder, makes the runs that are not done yet (run_rows), scores every volume, and writes
/// comparison.json, comparison.csv, profile.csv, report.html (report/html.h: one file, no network)
/// and the pictures of the report into the folder. Throws Error for all that can be found out in
/// advance before it makes or removes anything.
Outcome compare_methods(const CompareOptions& options, const RunHooks& hooks);

}  // namespace tomofield::compare
