#include "tune/trial_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/plausible.h"
#include "io/json.h"
#include "io/json_numbers.h"
#include "tomofield/error.h"

namespace tomofield::tune {
namespace {

using nlohmann::json;

// Errors are multiples of the noise's variance, and a fit that predicts nothing has large ones.
constexpr double kLargestError = 1e30;

// Says whether a trial has all of these settings.
bool has_settings(const json& trial, const json& settings) {
  return std::ranges::all_of(settings.items(), [&](const auto& setting) {
    const auto found = trial.find(setting.key());
    return found != trial.end() && *found == setting.value();
  });
}

}  // namespace

json trial_json(json settings, const HeldOutScore& score, double seconds) {
  settings.update({{"held_out_error", score.error},
                   {"held_out_error_by_view", score.view_error},
                   {"seconds", seconds}});
  if (!score.patch_error.empty()) settings["held_out_error_by_patch"] = score.patch_error;
  if (score.speckle) settings["speckle"] = *score.speckle;
  if (score.face_jump) settings["face_jump"] = *score.face_jump;
  return settings;
}

HeldOutScore score_from(const json& trial) {
  const auto measured = [&](const char* name) {
    return trial.contains(name) ? std::optional(io::number_at(trial, name, 0, kLargestError))
                                : std::nullopt;
  };
  return {io::number_at(trial, "held_out_error", 0, kLargestError),
          io::numbers_at(trial, "held_out_error_by_view", 0, kLargestError),
          trial.contains("held_out_error_by_patch")
              ? io::numbers_at(trial, "held_out_error_by_patch", 0, kLargestError)
              : std::vector<double>(),
          measured("speckle"), measured("face_jump")};
}

TrialFile::TrialFile(std::filesystem::path path, std::string fingerprint, bool reuse)
    : path_(std::move(path)), fingerprint_(std::move(fingerprint)) {
  if (!reuse || !std::filesystem::exists(path_)) return;
  const char* advice = "give --overwrite instead of --resume to start over";
  std::string found;
  try {
    const json document = io::read_json(path_);
    found = document.at("fingerprint").get<std::string>();
    for (const json& trial : document.at("trials")) {
      score_from(trial);  // throws if it is damaged
      io::number_at(trial, "seconds", 0, base::kLargestNumber);
      trials_.push_back(trial);
    }
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

std::optional<json> TrialFile::find(const json& settings) const {
  const auto found = std::ranges::find_if(
      trials_, [&](const json& trial) { return has_settings(trial, settings); });
  return found == trials_.end() ? std::nullopt : std::optional<json>(*found);
}

void TrialFile::add(json trial) {
  trials_.push_back(std::move(trial));
  if (path_.empty()) return;
  io::write_json(path_, {{"fingerprint", fingerprint_}, {"trials", trials_}});
}

}  // namespace tomofield::tune
