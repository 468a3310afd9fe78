#include "batch/choice.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/plausible.h"
#include "batch/begun_settings.h"
#include "io/json.h"
#include "kernels/spikes.h"
#include "tomofield/error.h"

namespace tomofield::batch {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

bool has_vote(const Vote& vote) { return vote.failure.empty(); }

bool takes_choice(const Job& job) { return !job.is_skipped && job.needs.open_variation; }

// Returns the votes for the penalty that most of them are for.
std::vector<Vote> majority(const std::vector<Vote>& votes) {
  std::vector<Vote> smooth, concave;
  for (const Vote& vote : votes)
    if (has_vote(vote))
      (vote.settings.penalty == Penalty::kSmooth ? smooth : concave).push_back(vote);
  return concave.size() > smooth.size() ? concave : smooth;
}

// Returns the median of weights, on a logarithmic scale, as users can give it.
double median_weight(const std::vector<Vote>& votes) {
  std::vector<double> weights;
  for (const Vote& vote : votes) weights.push_back(vote.settings.variation);
  std::ranges::sort(weights);
  const double below = weights[(weights.size() - 1) / 2], above = weights[weights.size() / 2];
  return std::stod(fmt::format("{:.3g}", std::sqrt(below * above)));
}

// Returns the median of the limits. Of two that differ it takes the one that limits more.
std::optional<int> median_spike_rank(const std::vector<Vote>& votes) {
  std::vector<int> ranks;
  for (const Vote& vote : votes)
    if (vote.settings.spike_rank) ranks.push_back(*vote.settings.spike_rank);
  if (ranks.empty()) return std::nullopt;
  std::ranges::sort(ranks);
  return ranks[ranks.size() / 2];
}

// Returns the prior of most votes; total variation if there is no majority.
std::optional<Prior> prior_of_most(const std::vector<Vote>& votes) {
  std::ptrdiff_t learned = 0, any = 0;
  for (const Vote& vote : votes) {
    any += vote.settings.prior.has_value();
    learned += vote.settings.prior == Prior::kLearned;
  }
  if (any == 0) return std::nullopt;
  return 2 * learned > any ? Prior::kLearned : Prior::kTv;
}

std::string settings_text(const SharedSettings& settings) {
  return fmt::format("{} tv {:.3g}{}{}", base::name_of(settings.penalty), settings.variation,
                     settings.spike_rank == 0 ? ", spikes kept" : "",
                     settings.prior == Prior::kLearned ? ", learned prior" : "");
}

json settings_json(const SharedSettings& settings) {
  return {{"tv_penalty", base::name_of(settings.penalty)},
          {"tv", settings.variation},
          {"spike_rank", settings.spike_rank ? json(*settings.spike_rank) : json(nullptr)},
          {"prior", settings.prior ? json(base::name_of(*settings.prior)) : json(nullptr)}};
}

json vote_json(const Vote& vote) {
  json entry = has_vote(vote) ? settings_json(vote.settings) : json{{"failure", vote.failure}};
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
  if (std::ranges::none_of(choice.votes, has_vote))
    throw Error("no series under 'votes' has chosen anything");
  return choice;
}

// Returns the words that give shared settings to a job.
std::vector<std::string> settings_words(const SharedSettings& settings, const Needs& needs) {
  std::vector<std::string> words{fmt::format("--tv-penalty={}", base::name_of(settings.penalty)),
                                 fmt::format("--tv={}", settings.variation)};
  if (needs.open_spike_rank && settings.spike_rank)
    words.push_back(fmt::format("--spike-rank={}", *settings.spike_rank));
  if (needs.open_prior && settings.prior)
    words.push_back(fmt::format("--prior={}", base::name_of(*settings.prior)));
  return words;
}

// Lets the jobs that have begun go on with the settings that they began with. Without an entry in
// the list of the earlier batch, a job takes the stored choice if there is one. Returns the jobs
// whose settings differ from the stored ones.
std::vector<std::size_t> keep_begun_settings(const fs::path& folder,
                                             const std::optional<Choice>& stored,
                                             std::vector<Job>& jobs) {
  std::vector<std::size_t> differing;
  const auto begun = begun_settings(folder);
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    Job& job = jobs[i];
    const auto entry = begun.find(job.name);
    if (!takes_choice(job) || !has_checkpoint(job.output)) continue;
    if (entry == begun.end() && stored) continue;
    if (entry != begun.end()) {
      if (stored && entry->second != settings_words(stored->settings, job.needs))
        differing.push_back(i);
      job.command.insert(job.command.end(), entry->second.begin(), entry->second.end());
    }
    job.needs.open_variation = job.needs.open_spike_rank = job.needs.open_prior = false;
  }
  return differing;
}

// Reads a file of a choice. Mistakes in it are errors that name it.
template <typename Read>
auto read_choice_file(const fs::path& file, const char* what, const Read& read) {
  return io::read_record(file, read, [&](const std::string& why) {
    return fmt::format("'{}' is not {} ({}): remove it, and the batch chooses again", file.string(),
                       what, why);
  });
}

}  // namespace

ChoicePlan plan_choice(const fs::path& folder, bool continues, std::vector<Job>& jobs) {
  if (continues) {
    std::optional<Choice> stored = read_choice(folder);
    std::vector<std::size_t> differing = keep_begun_settings(folder, stored, jobs);
    if (stored)
      return {.stored = std::move(stored), .choosing = {}, .differing = std::move(differing)};
  }
  std::vector<std::size_t> able;
  for (std::size_t i = 0; i < jobs.size(); ++i)
    if (takes_choice(jobs[i]) && jobs[i].needs.num_trials > 0) able.push_back(i);
  if (able.empty() || std::ranges::count_if(jobs, takes_choice) < 2) return {};
  ChoicePlan plan;
  for (const std::size_t at : {std::size_t{0}, able.size() / 2, able.size() - 1})
    if (!std::ranges::count(plan.choosing, able[at])) plan.choosing.push_back(able[at]);
  return plan;
}

std::optional<Choice> count_votes(std::vector<Vote> votes) {
  const std::vector<Vote> winners = majority(votes);
  if (winners.empty()) return std::nullopt;
  return Choice{.settings = {.penalty = winners.front().settings.penalty,
                             .variation = median_weight(winners),
                             .spike_rank = median_spike_rank(winners),
                             .prior = prior_of_most(winners)},
                .votes = std::move(votes)};
}

void give_choice(const Choice& choice, std::vector<Job>& jobs) {
  for (Job& job : jobs) {
    if (!takes_choice(job)) continue;
    const std::vector<std::string> words = settings_words(choice.settings, job.needs);
    job.command.insert(job.command.end(), words.begin(), words.end());
  }
}

std::string describe(const Choice& choice) {
  std::vector<std::string> votes;
  for (const Vote& vote : choice.votes)
    votes.push_back(fmt::format(
        "{} ({})", vote.series,
        has_vote(vote) ? settings_text(vote.settings) : "its trials failed: " + vote.failure));
  return fmt::format("{}, by the trials of {}", settings_text(choice.settings),
                     fmt::join(votes, ", "));
}

fs::path choice_file(const fs::path& folder) { return folder / "choice.json"; }

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
  return read_choice_file(file, "the choice of a batch", choice_from);
}

void forget_choice(const fs::path& folder) { fs::remove(choice_file(folder)); }

Vote read_vote(const Job& job, const fs::path& file) {
  return read_choice_file(file, "the choice of a run", [&](const json& document) {
    Vote vote;
    vote.series = job.name;
    if (document.is_null()) {
      vote.failure = "nothing was left to trials";
      return vote;
    }
    vote.settings = settings_from(document.at("chosen"));
    if (!job.needs.open_spike_rank) vote.settings.spike_rank.reset();
    if (!job.needs.open_prior) vote.settings.prior.reset();
    return vote;
  });
}

}  // namespace tomofield::batch
