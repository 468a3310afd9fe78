#include "tune/trial_record.h"

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "base/enum_names.h"
#include "base/plausible.h"
#include "io/json.h"
#include "kernels/spikes.h"
#include "tomofield/error.h"

namespace tomofield::tune {
namespace {

using nlohmann::json;

// Errors are multiples of the noise's variance, and a fit that predicts nothing has large ones.
constexpr double kLargestError = 1e30;

constexpr std::int64_t kMostOfAnything = 1000000000;

TrialSettings settings_from(const json& entry) {
  const auto penalty = base::enum_named<Penalty>(entry.at("tv_penalty").get<std::string>());
  if (!penalty) throw Error("'tv_penalty' is no penalty");
  const auto prior = base::enum_named<Prior>(entry.at("prior").get<std::string>());
  if (!prior) throw Error("'prior' is no prior");
  return {.penalty = *penalty,
          .variation = io::number_at(entry, "tv", 0, base::kLargestNumber),
          .rank = static_cast<int>(io::integer_at(entry, "rank", 1, kMostOfAnything)),
          .epochs = static_cast<int>(io::integer_at(entry, "epochs", 1, kMostOfAnything)),
          .fits_view_scale = entry.at("view_scale"),
          .background_part = io::number_at(entry, "background_part", 0, 1),
          .masks_beads = entry.at("masks_beads"),
          .spike_rank =
              static_cast<int>(io::integer_at(entry, "spike_rank", 0, kernels::kMostSpikeRank)),
          .prior = *prior};
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

json settings_json(const TrialSettings& s) {
  return {{"tv_penalty", base::name_of(s.penalty)},
          {"tv", s.variation},
          {"rank", s.rank},
          {"epochs", s.epochs},
          {"view_scale", s.fits_view_scale},
          {"background_part", s.background_part},
          {"masks_beads", s.masks_beads},
          {"spike_rank", s.spike_rank},
          {"prior", base::name_of(s.prior)}};
}

json to_json(const FitTrial& trial) {
  return trial_json(settings_json(trial.settings), trial.score, trial.seconds);
}

FitTrial trial_from(const json& entry) {
  return {.settings = settings_from(entry),
          .score = score_from(entry),
          .seconds = entry.contains("seconds")  // checkpoints have none
                         ? io::number_at(entry, "seconds", 0, base::kLargestNumber)
                         : 0.0};
}

std::string text_of(const FitTrial& trial) { return to_json(trial).dump(); }

FitTrial trial_from_text(const std::string& text) { return trial_from(json::parse(text)); }

void write_trials(const std::filesystem::path& file, const StoredTrials& stored) {
  json trials = json::array();
  for (const FitTrial& trial : stored.trials) trials.push_back(to_json(trial));
  io::write_json(file, {{"fingerprint", stored.fingerprint}, {"trials", trials}});
}

StoredTrials read_trials(const std::filesystem::path& file) {
  const auto read = [](const json& document) {
    StoredTrials stored{.fingerprint = document.at("fingerprint").get<std::string>(), .trials = {}};
    for (const json& trial : document.at("trials")) stored.trials.push_back(trial_from(trial));
    return stored;
  };
  return io::read_record(file, read, [](const std::string& why) { return why; });
}

json tuning_json(const TunedFit& tuned) {
  json tuning = tuned_json(tuned, settings_json);
  for (std::size_t i = 0; i < tuned.trials.size(); ++i) {
    const Difference d = difference_to_chosen(tuned.trials[i], tuned);
    tuning["trials"][i].update(
        {{"above_chosen", d.log_ratio}, {"standard_error", d.standard_error}});
  }
  return tuning;
}

TunedFit tuned_from(const json& tuning) {
  TunedFit tuned{
      .settings = settings_from(tuning.at("chosen")), .trials = {}, .predicted_views = {}};
  for (const double view : io::numbers_at(tuning, "predicted_views", 0, base::kLargestNumber))
    tuned.predicted_views.push_back(static_cast<int>(view));
  for (const json& trial : tuning.at("trials")) tuned.trials.push_back(trial_from(trial));
  for (const json& trial : tuning.at("last_trials")) tuned.last_trials.push_back(trial_from(trial));
  return tuned;
}

void write_choice(const std::filesystem::path& file, const std::optional<TunedFit>& tuned) {
  io::write_json(file, tuned ? tuning_json(*tuned) : json(nullptr));
}

std::optional<TunedFit> read_choice(const std::filesystem::path& file) {
  const auto read = [](const json& document) {
    return document.is_null() ? std::nullopt : std::optional(tuned_from(document));
  };
  return io::read_record(file, read, [&](const std::string& why) {
    return fmt::format("'{}' is not the choice of a run: {}", file.string(), why);
  });
}

}  // namespace tomofield::tune
