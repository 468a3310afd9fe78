#include "batch/job.h"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>

#include "batch/state_record.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::batch {
namespace {

using testing::ScratchDirectory;

TEST(Jobs, AreReadAsTheyAreWritten) {
  const ScratchDirectory directory;
  JobList list{.jobs = {{.name = "a",
                         .output = "out/ä b.mrc",
                         .command = {"reconstruct", "a.mrc", "--center=-3,4"},
                         .needs = {.memory_bytes_of_one_thread = 1000,
                                   .memory_bytes_a_thread = 10,
                                   .core_seconds = 2.5,
                                   .sample_steps = 1e9,
                                   .result_bytes = 20,
                                   .disk_bytes = 30,
                                   .open_variation = true,
                                   .open_spike_rank = false,
                                   .open_prior = true,
                                   .num_trials = 6},
                         .files = {},
                         .is_joined = true,
                         .replaces = true},
                        {.name = "b",
                         .output = "b.mrc",
                         .command = {},
                         .needs = {},
                         .is_skipped = true,
                         .files = {}}},
               .overwrites = true,
               .began_ns = 1234};
  write_jobs(directory / "batch.json", list);
  const JobList read = read_jobs(directory / "batch.json");
  EXPECT_TRUE(read.overwrites);
  EXPECT_EQ(read.began_ns, 1234);
  ASSERT_EQ(read.jobs.size(), 2u);
  EXPECT_EQ(read.jobs[0].output, list.jobs[0].output);
  EXPECT_EQ(read.jobs[0].command, list.jobs[0].command);
  EXPECT_EQ(read.jobs[0].needs.memory_bytes(4), 1030);
  EXPECT_EQ(read.jobs[0].needs.core_seconds, 2.5);
  EXPECT_EQ(read.jobs[0].needs.sample_steps, 1e9);
  EXPECT_TRUE(read.jobs[0].needs.open_variation);
  EXPECT_FALSE(read.jobs[0].needs.open_spike_rank);
  EXPECT_TRUE(read.jobs[0].needs.open_prior);
  EXPECT_EQ(read.jobs[0].needs.num_trials, 6);
  EXPECT_FALSE(read.jobs[0].is_skipped);
  EXPECT_TRUE(read.jobs[0].is_joined && read.jobs[0].replaces);
  EXPECT_FALSE(read.jobs[1].is_joined || read.jobs[1].replaces);
  EXPECT_TRUE(read.jobs[1].is_skipped);
  EXPECT_FALSE(read.jobs[1].needs.core_seconds.has_value());
  list.jobs[0].command.emplace_back("\xff");
  EXPECT_THROW(write_jobs(directory / "batch.json", list), Error);
}

TEST(Jobs, OfADamagedListAreRefused) {
  const ScratchDirectory directory;
  for (const char* text : {"", "[]", "{}", R"({"overwrites": 1, "jobs": []})",
                           R"({"overwrites": true, "jobs": [{"name": "a"}]})"}) {
    const auto file = directory.write("batch.json", text);
    EXPECT_NE(testing::message_of<Error>([&] { read_jobs(file); }).find("batch.json"),
              std::string::npos)
        << text;
  }
}

TEST(Jobs, AreCalledAfterNoOtherFolder) {
  const ScratchDirectory directory;
  for (const char* name : {"/tmp/evil", "../../evil", "a/b", "..", ".", ""}) {
    JobList list;
    list.jobs.emplace_back().name = name;
    write_jobs(directory / "batch.json", list);
    EXPECT_NE(testing::message_of<Error>([&] {
                read_jobs(directory / "batch.json");
              }).find(std::string("'") + name + "'"),
              std::string::npos)
        << name;
  }
}

TEST(Jobs, HaveTheirOwnFilesToRemoveInPlaceOfTheAdviceOfARun) {
  const ScratchDirectory directory;
  for (const char* name : {"a.h5", "a_xy.png", "b.json"}) directory.write(name, "");
  const std::string advice = ": remove 'a.h5', 'a_xy.png' from '" + directory.path().string() +
                             "', and the batch runs this series again, or leave it out";
  const auto reason = [&](const std::string& said) {
    return reason_in_batch(said, directory / "a.mrc");
  };
  EXPECT_EQ(reason("'a.h5' exists: give --overwrite to replace it, or another name with -o"),
            "'a.h5' exists" + advice);
  EXPECT_EQ(reason("cannot resume: 'a.h5' is odd; to start over, give --overwrite"),
            "cannot resume: 'a.h5' is odd" + advice);
  EXPECT_EQ(reason("section 3 is black"), "section 3 is black");
}

TEST(Jobs, AreNotFinishedByFilesThatCannotBeRead) {
  const ScratchDirectory directory;
  for (const char* name : {"a.mrc", "a.json"}) directory.write(name, "");
  EXPECT_NE(fault_of_results(directory / "a.mrc").find("a.mrc"), std::string::npos);
}

TEST(Jobs, HaveProgressInTilesAndInAnAlignment) {
  const testing::ScratchDirectory scratch;
  EXPECT_FALSE(last_progress(scratch / "a.mrc"));
  for (const char* name : {"a_align.json", "a_tiles.h5"}) {
    const auto before = last_progress(scratch / "a.mrc");
    std::filesystem::last_write_time(
        scratch.write(name, ""),
        before.value_or(std::filesystem::file_time_type::clock::now()) + std::chrono::seconds(5));
    EXPECT_NE(last_progress(scratch / "a.mrc"), before) << name;
  }
}

TEST(Jobs, GoOnFromNewerFilesAlone) {
  const testing::ScratchDirectory scratch;
  const auto now = std::filesystem::file_time_type::clock::now();
  const auto write = [&](const char* name, std::chrono::seconds later) {
    std::filesystem::last_write_time(scratch.write(name, ""), now + later);
  };
  Job job;
  job.output = scratch / "a.mrc";
  job.replaces = true;
  write("a.h5", std::chrono::seconds(0));
  write("a_tiles.h5", std::chrono::seconds(5));
  const State before{.progress = Progress::kRunning,
                     .reason = {},
                     .costs = {},
                     .old_checkpoint_ns = checkpoint_time_ns(job)};
  EXPECT_FALSE(continues(before, job));
  std::filesystem::remove(scratch / "a_tiles.h5");  // by a run that starts over
  EXPECT_FALSE(continues(before, job));
  write("a.h5", std::chrono::seconds(9));
  EXPECT_TRUE(continues(before, job));
}

TEST(Needs, ComeFromThePlanOfARun) {
  const auto needs = [](std::int64_t threads) {
    return needs_of({.num_trials = 6,
                     .open_variation = true,
                     .num_threads = threads,
                     .memory_bytes = 1300,
                     .memory_bytes_of_one_thread = 1000,
                     .core_seconds = 1.5,
                     .disk_bytes = 9});
  };
  EXPECT_EQ(needs(4).memory_bytes(2), 1100);
  EXPECT_EQ(needs(1).memory_bytes(2), 1000);
  EXPECT_EQ(needs(4).core_seconds, 1.5);
  EXPECT_EQ(needs(4).disk_bytes, 9);
  EXPECT_TRUE(needs(4).open_variation);
  EXPECT_FALSE(needs(4).open_spike_rank);
  EXPECT_EQ(needs(4).num_trials, 6);
}

TEST(State, OfAJobIsKeptAndDamageIsForgotten) {
  const ScratchDirectory directory;
  Job job;
  job.name = "a";
  EXPECT_EQ(read_state(directory.path(), job).progress, Progress::kWaiting);
  std::filesystem::create_directory(log_folder(directory.path()));
  write_state(directory.path(), job,
              {.progress = Progress::kFailed,
               .reason = "\xffno",
               .costs = {.core_seconds = 1, .wall_seconds = 2, .peak_bytes = 3}});
  const State state = read_state(directory.path(), job);
  EXPECT_EQ(state.progress, Progress::kFailed);
  EXPECT_NE(state.reason.find("no"), std::string::npos);
  EXPECT_EQ(state.costs.peak_bytes, 3);
  directory.write("logs/a.state.json", "{");
  EXPECT_EQ(read_state(directory.path(), job).progress, Progress::kWaiting);
}

}  // namespace
}  // namespace tomofield::batch
