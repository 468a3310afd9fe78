#include "batch/choice.h"

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "batch/slurm.h"
#include "scratch_directory.h"
#include "tomofield/error.h"
#include "tune/trial_record.h"

namespace tomofield::batch {
namespace {

using testing::ScratchDirectory;

Vote vote(Penalty penalty, double variation, std::optional<int> spike_rank = 3,
          std::optional<Prior> prior = {}) {
  return {.series = "a",
          .settings = {.penalty = penalty,
                       .variation = variation,
                       .spike_rank = spike_rank,
                       .prior = prior},
          .failure = {}};
}

Vote no_vote() {
  Vote made;
  made.series = "broken";
  made.failure = "its views are black";
  return made;
}

// Jobs that leave everything to trials, with these results in a folder.
std::vector<Job> open_jobs(int count, const std::filesystem::path& folder) {
  std::vector<Job> jobs(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    jobs[i].name = std::string(1, static_cast<char>('a' + i));
    jobs[i].output = folder / (jobs[i].name + ".mrc");
    jobs[i].needs.open_variation = jobs[i].needs.open_spike_rank = true;
    jobs[i].needs.num_trials = 6;
  }
  return jobs;
}

TEST(CountVotes, TakesTheMedianOfThePenaltyThatMostAreFor) {
  const auto smooth = count_votes(
      {vote(Penalty::kSmooth, 8), vote(Penalty::kConcave, 14), vote(Penalty::kSmooth, 2, 0)});
  ASSERT_TRUE(smooth);
  EXPECT_EQ(smooth->settings.penalty, Penalty::kSmooth);
  EXPECT_EQ(smooth->settings.variation, 4);  // the geometric mean of two
  EXPECT_EQ(smooth->settings.spike_rank, 3);
  EXPECT_EQ(smooth->votes.size(), 3u);
  const auto of_three = count_votes(
      {vote(Penalty::kConcave, 25), vote(Penalty::kConcave, 14), vote(Penalty::kConcave, 14)});
  EXPECT_EQ(of_three->settings.penalty, Penalty::kConcave);
  EXPECT_EQ(of_three->settings.variation, 14);
}

TEST(CountVotes, IsSmoothWithoutAMajorityAndNothingWithoutVotes) {
  EXPECT_EQ(count_votes({vote(Penalty::kConcave, 14), vote(Penalty::kSmooth, 5)})->settings.penalty,
            Penalty::kSmooth);
  const auto one = count_votes({no_vote(), vote(Penalty::kConcave, 14, {})});
  EXPECT_EQ(one->settings.penalty, Penalty::kConcave);
  EXPECT_FALSE(one->settings.spike_rank.has_value());
  EXPECT_FALSE(count_votes({no_vote()}).has_value());
}

TEST(CountVotes, TakesTheLearnedPriorIfMostAreForIt) {
  const Vote learned = vote(Penalty::kSmooth, 5, 3, Prior::kLearned);
  const Vote without = vote(Penalty::kSmooth, 5, 3, Prior::kTv);
  EXPECT_EQ(count_votes({learned, without, learned})->settings.prior, Prior::kLearned);
  EXPECT_EQ(count_votes({learned, without})->settings.prior, Prior::kTv);
  EXPECT_FALSE(count_votes({vote(Penalty::kSmooth, 5)})->settings.prior.has_value());
}

TEST(GiveChoice, GivesThePriorToSeriesThatLeaveItOpen) {
  const Choice choice = *count_votes({vote(Penalty::kSmooth, 4.5, 3, Prior::kLearned)});
  std::vector<Job> jobs = open_jobs(2, "/");
  jobs[0].needs.open_prior = true;
  give_choice(choice, "/out", jobs);
  EXPECT_EQ(jobs[0].command[3], "--prior=learned");
  EXPECT_EQ(jobs[0].command.back(), "--batch-choice=/out/choice.json");
  EXPECT_EQ(jobs[1].command[2], "--spike-rank=3");
}

TEST(PlanChoice, LetsTheFirstTheMiddleAndTheLastOfTheListChoose) {
  const ScratchDirectory directory;
  const auto choosing = [&](std::vector<Job> jobs) {
    return plan_choice(directory.path(), false, jobs).choosing;
  };
  using Numbers = std::vector<std::size_t>;
  EXPECT_EQ(choosing(open_jobs(1, directory.path())), Numbers{});  // there is nothing to share
  EXPECT_EQ(choosing(open_jobs(2, directory.path())), (Numbers{0, 1}));
  EXPECT_EQ(choosing(open_jobs(9, directory.path())), (Numbers{0, 4, 8}));
  std::vector<Job> jobs = open_jobs(5, directory.path());
  jobs[0].is_skipped = true;
  jobs[2].needs.open_variation = false;  // it has a weight of its own
  jobs[4].needs.num_trials = 0;          // it has too few views
  EXPECT_EQ(choosing(jobs), (Numbers{1, 3}));
}

TEST(PlanChoice, NamesTheOneSeriesOfSeveralThatIsLeftToChoose) {
  const ScratchDirectory directory;
  std::vector<Job> jobs = open_jobs(3, directory.path());
  jobs[0].is_skipped = jobs[2].is_skipped = true;
  ChoicePlan plan = plan_choice(directory.path(), true, jobs);
  EXPECT_TRUE(plan.choosing.empty());
  EXPECT_EQ(plan.alone, 1u);
  jobs[2].is_skipped = false;
  EXPECT_FALSE(plan_choice(directory.path(), true, jobs).alone.has_value());
  jobs.resize(1);
  jobs[0].is_skipped = false;  // a batch of one shares nothing
  EXPECT_FALSE(plan_choice(directory.path(), true, jobs).alone.has_value());
}

TEST(PlanChoice, TakesTheStoredOneIfTheBatchGoesOn) {
  const ScratchDirectory directory;
  std::vector<Job> jobs = open_jobs(3, directory.path());
  directory.write("b.h5", "");  // the checkpoint of a series that chose for itself
  EXPECT_EQ(plan_choice(directory.path(), true, jobs).choosing, (std::vector<std::size_t>{0, 2}));
  EXPECT_FALSE(jobs[1].needs.open_variation);
  write_choice(directory.path(), *count_votes({vote(Penalty::kSmooth, 4.5, 0), no_vote()}));
  jobs = open_jobs(3, directory.path());
  const ChoicePlan plan = plan_choice(directory.path(), true, jobs);
  EXPECT_TRUE(plan.choosing.empty());
  ASSERT_TRUE(plan.stored);
  EXPECT_EQ(plan.stored->settings.variation, 4.5);
  EXPECT_EQ(plan.stored->settings.spike_rank, 0);
  EXPECT_EQ(plan.stored->votes[1].failure, "its views are black");
  EXPECT_NE(describe(*plan.stored).find("smooth tv 4.5, spikes kept, by the trials of a (smooth"),
            std::string::npos)
      << describe(*plan.stored);
  EXPECT_FALSE(plan_choice(directory.path(), false, jobs).stored.has_value());
  forget_choice(directory.path());
  EXPECT_FALSE(read_choice(directory.path()).has_value());
}

TEST(PlanChoice, LetsSeriesThatHaveBegunGoOnWithTheirSettings) {
  const ScratchDirectory directory;
  using Words = std::vector<std::string>;
  std::vector<Job> jobs = open_jobs(4, directory.path());
  give_choice(*count_votes({vote(Penalty::kSmooth, 4.5)}), directory.path(), jobs);
  jobs.pop_back();  // the last series is new in the list of the next batch
  write_jobs(list_of(directory.path()), {.jobs = jobs, .overwrites = false});
  for (const char* model : {"a.h5", "d.h5"}) directory.write(model, "");
  const auto planned = [&] {
    std::vector<Job> next = open_jobs(4, directory.path());
    const ChoicePlan plan = plan_choice(directory.path(), true, next);
    if (plan.stored) give_choice(*plan.stored, directory.path(), next);
    return std::pair(plan, next);
  };
  write_choice(directory.path(), *count_votes({vote(Penalty::kConcave, 14)}));  // edited
  auto [plan, next] = planned();
  const std::string file = "--batch-choice=" + choice_file(directory.path()).string();
  const Words smooth{"--tv-penalty=smooth", "--tv=4.5", "--spike-rank=3", file};
  EXPECT_EQ(next[0].command, smooth);
  EXPECT_EQ(next[1].command, (Words{"--tv-penalty=concave", "--tv=14", "--spike-rank=3", file}));
  EXPECT_EQ(next[3].command, next[1].command);  // nothing says what it began with
  EXPECT_EQ(plan.differing, std::vector<std::size_t>{0});
  write_choice(directory.path(), *count_votes({vote(Penalty::kSmooth, 4.5)}));
  EXPECT_TRUE(planned().first.differing.empty());
  jobs[0].command.push_back("--spike-rank=3");  // as an earlier version left it
  write_jobs(list_of(directory.path()), {.jobs = jobs, .overwrites = false});
  std::vector<Job> stating = open_jobs(1, directory.path());
  stating[0].command = {"--spike-rank=3"};
  stating[0].needs.open_spike_rank = false;
  EXPECT_TRUE(plan_choice(directory.path(), true, stating).differing.empty());
  EXPECT_EQ(stating[0].command, (Words{"--spike-rank=3", "--tv-penalty=smooth", "--tv=4.5", file}));
  forget_choice(directory.path());
  next = planned().second;
  EXPECT_EQ(next[0].command, smooth);
  EXPECT_TRUE(next[1].command.empty());
  directory.write("batch.json", R"({"jobs": [{}]})");
  const std::string said = testing::message_of<Error>(planned);
  EXPECT_NE(said.find("batch.json' is not the list of a batch (there is no 'command')"),
            std::string::npos)
      << said;
}

TEST(GiveChoice, AddsWhatASeriesLacks) {
  std::vector<Job> jobs = open_jobs(3, "out");
  jobs[1].needs.open_spike_rank = false;
  jobs[2].needs.open_variation = jobs[2].needs.open_spike_rank = false;
  give_choice(*count_votes({vote(Penalty::kSmooth, 4.5)}), "out", jobs);
  using Words = std::vector<std::string>;
  const std::string file = "--batch-choice=out/choice.json";
  EXPECT_EQ(jobs[0].command, (Words{"--tv-penalty=smooth", "--tv=4.5", "--spike-rank=3", file}));
  EXPECT_EQ(jobs[1].command, (Words{"--tv-penalty=smooth", "--tv=4.5", file}));
  EXPECT_TRUE(jobs[2].command.empty());
}

TEST(VoteOf, TakesWhatARunChose) {
  const ScratchDirectory directory;
  Job job;
  job.name = "a";
  const auto file = directory / "a.json";
  tune::write_choice(file, tune::TunedFit{.settings = {.penalty = Penalty::kConcave,
                                                       .variation = 14,
                                                       .rank = 12,
                                                       .epochs = 30,
                                                       .spike_rank = 3,
                                                       .prior = Prior::kLearned},
                                          .trials = {},
                                          .predicted_views = {}});
  const auto chosen = tune::read_choice(file);
  EXPECT_FALSE(vote_of(job, chosen).settings.spike_rank.has_value());  // it was given
  job.needs.open_spike_rank = true;
  EXPECT_EQ(vote_of(job, chosen).settings.spike_rank, 3);
  EXPECT_EQ(vote_of(job, chosen).settings.penalty, Penalty::kConcave);
  EXPECT_EQ(vote_of(job, chosen).settings.variation, 14);
  EXPECT_EQ(vote_of(job, chosen).series, "a");
  EXPECT_TRUE(vote_of(job, chosen).is_valid());
  tune::write_choice(file, std::nullopt);
  EXPECT_FALSE(vote_of(job, tune::read_choice(file)).is_valid());
  for (const char* text : {"{}", R"({"chosen": {"tv_penalty": "flat", "tv": 14}})"})
    EXPECT_THROW(tune::read_choice(directory.write("c.json", text)), Error) << text;
}

TEST(ReadChoice, RefusesADamagedFileAndSaysWhatIsWrongAndWhatToDo) {
  const ScratchDirectory directory;
  const auto said_of = [&](const std::string& text) {
    directory.write("choice.json", text);
    return testing::message_of<Error>([&] { read_choice(directory.path()); });
  };
  const std::string settings =
      R"("tv_penalty": "smooth", "tv": 5, "spike_rank": null, "prior": null)";
  const std::pair<std::string, std::string> faults[] = {
      {"{\"tv\": 5,\n \"votes\"", "line 2, column"},
      {R"({"tv": 5})", "there is no 'tv_penalty'"},
      {R"({"tv_penalty": 5, "tv": 5})", "another kind"},
      {R"({"tv_penalty": "flat", "tv": 5})", "'tv_penalty'"},
      {R"({"tv_penalty": "smooth", "tv": "5"})", "'tv'"},
      {"{" + settings + "}", "there is no 'votes'"},
      {"{" + settings + R"(, "votes": []})", "'votes'"},
      {"{" + settings + R"(, "votes": [{"series": "a", "failure": "it is black"}]})", "'votes'"}};
  for (const auto& [text, fault] : faults) {
    const std::string said = said_of(text);
    for (const std::string& fact : {std::string("choice.json"), fault, std::string("remove it")})
      EXPECT_NE(said.find(fact), std::string::npos) << text << ": " << said;
    EXPECT_EQ(said.find("exception"), std::string::npos) << said;  // the library's words
  }
}

}  // namespace
}  // namespace tomofield::batch
