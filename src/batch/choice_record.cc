#include <fmt/format.h>

#include <algorithm>

#include "base/plausible.h"
#include "batch/choice.h"
#include "io/json.h"
#include "kernels/spikes.h"
#include "tomofield/error.h"

// The choice of a batch and its votes (choice.json).
namespace tomofield::batch {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

json settings_json(const SharedSettings& settings) {
  return {{"tv_penalty", base::name_of(settings.penalty)},
          {"tv", settings.variation},
          {"spike_rank", settings.spike_rank ? json(*settings.spike_rank) : json(nullptr)},
          {"prior", settings.prior ? json(base::name_of(*settings.prior)) : json(nullptr)}};
}

json vote_json(const Vote& vote) {
  json entry = vote.is_valid() ? settings_json(vote.settings) : json{{"failure", vote.failure}};
  entry["series"] = vote.series;
  return entry;
}

SharedSettings settings_from(const json& entry) {
  SharedSettings settings;
  const auto penalty = base::enum_named<Penalty>(entry.at("tv_penalty").get<std::string>());
  if (!penalty) throw Error("'tv_penalty' is neither smooth nor concave");
  settings.penalty = *penalty;
  settings.variation = io::number_at(entry, "tv", 0, base::kLargestNumber);
  if (!entry.at("spike_rank").is_null())
    settings.spike_rank =
        static_cast<int>(io::integer_at(entry, "spike_rank", 0, kernels::kMostSpikeRank));
  if (!entry.at("prior").is_null()) {
    settings.prior = base::enum_named<Prior>(entry.at("prior").get<std::string>());
    if (!settings.prior) throw Error("'prior' is neither tv nor learned");
  }
  return settings;
}

Vote vote_from(const json& entry) {
  Vote vote;
  vote.series = entry.at("series").get<std::string>();
  if (entry.contains("failure"))
    vote.failure = entry.at("failure").get<std::string>();
  else
    vote.settings = settings_from(entry);
  return vote;
}

Choice choice_from(const json& document) {
  Choice choice{.settings = settings_from(document), .votes = {}};
  for (const json& vote : document.at("votes")) choice.votes.push_back(vote_from(vote));
  if (std::ranges::none_of(choice.votes, &Vote::is_valid))
    throw Error("no series under 'votes' has chosen anything");
  return choice;
}

}  // namespace

void write_choice(const fs::path& folder, const Choice& choice) {
  json document = settings_json(choice.settings);
  document["tomofield"] = TOMOFIELD_VERSION;
  document["votes"] = json::array();
  for (const Vote& vote : choice.votes) document["votes"].push_back(vote_json(vote));
  io::write_json(choice_file(folder), document);
}

std::optional<Choice> read_choice(const fs::path& folder) {
  const fs::path file = choice_file(folder);
  if (!fs::exists(file)) return std::nullopt;
  return io::read_record(file, choice_from, [&](const std::string& why) {
    return fmt::format(
        "'{}' is not the choice of a batch ({}): remove it, and the series that are left choose "
        "again",
        file.string(), why);
  });
}

}  // namespace tomofield::batch
