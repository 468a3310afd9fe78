#include "tune/trial_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "tomofield/error.h"
#include "tune/trial_record.h"

namespace tomofield::tune {

TrialFile::TrialFile(std::filesystem::path path, std::string fingerprint, bool reuse)
    : path_(std::move(path)), fingerprint_(std::move(fingerprint)) {
  if (!reuse || !std::filesystem::exists(path_)) return;
  const char* advice = "give --overwrite instead of --resume to start over";
  std::string found;
  try {
    StoredTrials stored = read_trials(path_);
    found = std::move(stored.fingerprint);
    trials_ = std::move(stored.trials);
  } catch (const Error& error) {
    throw Error(fmt::format("cannot resume: '{}' is damaged ({}); {}", path_.string(), error.what(),
                            advice));
  }
  if (found != fingerprint_) {
    throw Error(fmt::format(
        "cannot resume: the trials in '{}' are of another series or of other options; {}",
        path_.string(), advice));
  }
}

std::optional<FitTrial> TrialFile::find(const TrialSettings& settings) const {
  const auto found = std::ranges::find(trials_, settings, &FitTrial::settings);
  return found == trials_.end() ? std::nullopt : std::optional(*found);
}

void TrialFile::add(const FitTrial& trial) {
  trials_.push_back(trial);
  trials_.back().section = {};  // files keep none
  if (path_.empty()) return;
  write_trials(path_, {fingerprint_, trials_});
}

}  // namespace tomofield::tune
