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

/// Throws Error if there is no method, no such series or no such truth.
void check_comparison(const CompareOptions& options);

enum class Outcome { kFinished, kStopped, kStoppedBeforeRuns };

/// Checks what would stop it later (rehearse), makes the folder, runs what has not been run yet
/// (run_rows), scores every volume and writes into the folder comparison.json, comparison.csv,
/// report.html (report/html.h: one file, no network) and the pictures that are in it. Throws Error
/// before anything is made or removed for what can be found out before.
Outcome compare_methods(const CompareOptions& options, const RunHooks& hooks);

}  // namespace tomofield::compare
