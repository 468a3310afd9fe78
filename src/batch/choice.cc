#include "batch/choice.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "batch/slurm.h"
#include "batch/state_record.h"

namespace tomofield::batch {
namespace {

namespace fs = std::filesystem;

bool takes_choice(const Job& job) { return !job.is_skipped && job.needs.open_variation; }

// Returns the votes for the penalty that most of them are for.
std::vector<Vote> majority(const std::vector<Vote>& votes) {
  std::vector<Vote> smooth, concave;
  for (const Vote& vote : votes)
    if (vote.is_valid())
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

// Adds the words that give shared settings to a job.
void give_words(const std::vector<std::string>& words, const fs::path& folder, Job& job) {
  if (words.empty()) return;
  job.command.insert(job.command.end(), words.begin(), words.end());
  job.command.push_back("--batch-choice=" + choice_file(folder).string());
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

std::string_view flag_of(std::string_view word) { return word.substr(0, word.find('=')); }

bool has_flag_of(const std::vector<std::string>& command, std::string_view word) {
  return std::ranges::find(command, flag_of(word), flag_of) != command.end();
}

// Returns the words of a command that give settings which the series of a batch share.
std::vector<std::string> shared_words(const std::vector<std::string>& command) {
  std::vector<std::string> words;
  for (const std::string& word : command)  // an earlier version may have left one twice
    if (is_shared(flag_of(word)) && !has_flag_of(words, word)) words.push_back(word);
  return words;
}

// Returns the words whose flags a command does not have: it states the others itself.
std::vector<std::string> without_those_of(const std::vector<std::string>& command,
                                          std::vector<std::string> words) {
  std::erase_if(words, [&](const std::string& word) { return has_flag_of(command, word); });
  return words;
}

// Returns these words of each series that the list of an earlier batch in this folder has, by its
// name; without such a list none.
std::map<std::string, std::vector<std::string>> begun_settings(const fs::path& folder) {
  std::map<std::string, std::vector<std::string>> settings;
  const fs::path file = list_of(folder);
  if (!fs::exists(file)) return settings;
  for (const auto& [name, command] : read_commands(file)) settings[name] = shared_words(command);
  return settings;
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
    if (!continues(read_state(folder, job), job)) continue;  // the checkpoint is to be replaced
    if (entry == begun.end() && stored) continue;
    if (entry != begun.end()) {
      const auto words = without_those_of(job.command, entry->second);
      if (stored && words != settings_words(stored->settings, job.needs)) differing.push_back(i);
      give_words(words, folder, job);
    }
    job.needs.open_variation = job.needs.open_spike_rank = job.needs.open_prior = false;
  }
  return differing;
}

}  // namespace

bool is_shared(std::string_view flag) {
  return flag == "--tv" || flag == "--tv-penalty" || flag == "--spike-rank" || flag == "--prior";
}

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
  if (able.empty()) return {};
  ChoicePlan plan;
  if (std::ranges::count_if(jobs, takes_choice) < 2) {
    if (jobs.size() > 1) plan.alone = able.front();
    return plan;
  }
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

void give_choice(const Choice& choice, const fs::path& folder, std::vector<Job>& jobs) {
  for (Job& job : jobs)
    if (takes_choice(job)) give_words(settings_words(choice.settings, job.needs), folder, job);
}

std::string describe(const Choice& choice) {
  std::vector<std::string> votes;
  for (const Vote& vote : choice.votes)
    votes.push_back(fmt::format(
        "{} ({})", vote.series,
        vote.is_valid() ? settings_text(vote.settings) : "its trials failed: " + vote.failure));
  return fmt::format("{}, by the trials of {}", settings_text(choice.settings),
                     fmt::join(votes, ", "));
}

fs::path choice_file(const fs::path& folder) { return folder / "choice.json"; }

Vote vote_of(const Job& job, const std::optional<tune::TunedFit>& chosen) {
  if (!chosen) return {.series = job.name, .settings = {}, .failure = "nothing was left to trials"};
  const tune::TrialSettings& settings = chosen->settings;
  Vote vote{.series = job.name,
            .settings = {.penalty = settings.penalty,
                         .variation = settings.variation,
                         .spike_rank = {},
                         .prior = {}},
            .failure = {}};
  if (job.needs.open_spike_rank) vote.settings.spike_rank = settings.spike_rank;
  if (job.needs.open_prior) vote.settings.prior = settings.prior;
  return vote;
}

void forget_choice(const fs::path& folder) { fs::remove(choice_file(folder)); }

}  // namespace tomofield::batch
