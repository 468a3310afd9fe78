#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tune/trial_settings.h"

namespace tomofield::tune {

/// Keeps the finished trials of a search in a file (JSON), so that an interrupted run need not
/// repeat them.
class TrialFile {
 public:
  /// With `reuse`, reads the trials of an earlier run if the file exists. Throws Error if they
  /// belong to another `fingerprint` (series and options) or are damaged. With an empty path, it
  /// keeps the trials in memory alone.
  TrialFile(std::filesystem::path path, std::string fingerprint, bool reuse);

  /// Returns the trial that was made with these settings, if there is one.
  std::optional<FitTrial> find(const TrialSettings& settings) const;
  /// Adds a trial and rewrites the file.
  void add(const FitTrial& trial);

 private:
  std::filesystem::path path_;
  std::string fingerprint_;
  std::vector<FitTrial> trials_;
};

}  // namespace tomofield::tune
