#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/enum_names.h"
#include "batch/job.h"
#include "tomofield/options.h"
#include "tune/trial_settings.h"

namespace tomofield::batch {

/// The series of a batch share one choice of total variation (penalty, weight and limit of spikes)
/// and of its prior, or each makes its own.
enum class Choose {
  kOnce,  ///< a few series make trials, and all get the same
  kEach   ///< every series makes trials of its own
};

/// Returns true for the flags of the settings which the series of a batch share, as "--tv".
bool is_shared(std::string_view flag);

/// The settings that the series of a batch share.
struct SharedSettings {
  Penalty penalty = Penalty::kSmooth;
  double variation = 0;           ///< weight in noise units, as --tv
  std::optional<int> spike_rank;  ///< nothing if no trials have chosen it
  std::optional<Prior> prior;     ///< likewise
};

/// A series votes with what its trials chose. It may have no vote, for a reason that is kept here.
struct Vote {
  std::string series;
  SharedSettings settings;
  std::string failure;  ///< empty if it has a vote

  bool is_valid() const { return failure.empty(); }
};

/// The settings that all series of a batch get if they do not state their own.
struct Choice {
  SharedSettings settings;
  std::vector<Vote> votes;  ///< those without a vote are among them
};

/// The source of a batch's choice. All members are empty if there is nothing to share.
struct ChoicePlan {
  std::optional<Choice> stored;        ///< of the batch that this one continues
  std::vector<std::size_t> choosing;   ///< jobs that are to make trials
  std::vector<std::size_t> differing;  ///< jobs that go on with other settings than the stored ones
  /// The one job of several that is left to choose. It chooses for itself.
  std::optional<std::size_t> alone = {};
};
/// Plans the choice of a batch. If it `continues` another one, series that have begun go on as they
/// were: their commands get the settings that the list of that batch (slurm.h) has for
/// them, and their `needs` are marked as settled. The others take the choice that is stored, if one
/// is. Else the first, the middle and the last of the series with trials are to choose, if there
/// are at least two series to share the choice.
ChoicePlan plan_choice(const std::filesystem::path& folder, bool continues, std::vector<Job>& jobs);

/// Returns the penalty of most votes (smooth if there is no majority), and the medians of the
/// weight and the limit of spikes of those who chose it. The prior is that of most of them (total
/// variation if there is no majority). Returns nothing if nobody has a vote.
std::optional<Choice> count_votes(std::vector<Vote> votes);

/// Adds the choice to the commands of the jobs that lack it, and the name of its file in the folder
/// of the batch, by which their reports say who chose.
void give_choice(const Choice& choice, const std::filesystem::path& folder, std::vector<Job>& jobs);

/// Describes a choice and the votes, as in "smooth tv 5, by the trials of a (smooth tv 4.8) and …".
std::string describe(const Choice& choice);

/// Returns the file of a batch's choice, choice.json in its folder.
std::filesystem::path choice_file(const std::filesystem::path& folder);
void write_choice(const std::filesystem::path& folder, const Choice& choice);
/// Returns nothing if there is none. Throws Error if it is damaged.
std::optional<Choice> read_choice(const std::filesystem::path& folder);
/// Removes a choice of an earlier batch.
void forget_choice(const std::filesystem::path& folder);

/// Returns the vote of a job whose trials chose that. It has none if nothing was left to them.
Vote vote_of(const Job& job, const std::optional<tune::TunedFit>& chosen);

}  // namespace tomofield::batch

template <>
struct tomofield::base::EnumNames<tomofield::batch::Choose> {
  static constexpr std::array kNames{std::pair{tomofield::batch::Choose::kOnce, "once"},
                                     std::pair{tomofield::batch::Choose::kEach, "each"}};
};
