#include "tune/trial_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "io/json.h"
#include "tomofield/error.h"
#include "tune/trial_record.h"

namespace tomofield::tune {

using nlohmann::json;

TrialFile::TrialFile(std::filesystem::path path, std::string fingerprint, bool reuse)
    : path_(std::move(path)), fingerprint_(std::move(fingerprint)) {
  if (!reuse || !std::filesystem::exists(path_)) return;
  const char* advice = "give --overwrite instead of --resume to start over";
  std::string found;
  try {
    const json document = io::read_json(path_);
    found = document.at("fingerprint").get<std::string>();
    for (const json& trial : document.at("trials")) trials_.push_back(trial_from(trial));
  } catch (const json::exception& error) {
    throw Error(fmt::format("cannot resume: '{}' is damaged ({}); {}", path_.string(),
                            io::fault_text(error), advice));
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
  json trials = json::array();
  for (const FitTrial& kept : trials_) trials.push_back(to_json(kept));
  io::write_json(path_, {{"fingerprint", fingerprint_}, {"trials", trials}});
}

}  // namespace tomofield::tune
