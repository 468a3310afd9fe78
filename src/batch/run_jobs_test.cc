#include "batch/run_jobs.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <thread>

#include "scratch_directory.h"

namespace tomofield::batch {
namespace {

// Returns the state of a job whose program ends at once with status 0.
State state_after_true(const testing::ScratchDirectory& scratch) {
  std::filesystem::create_directory(scratch / "logs");
  RunOptions options;
  options.program = "/bin/true";
  options.folder = scratch.path();
  const Job job{.name = "a", .output = scratch / "a.mrc", .command = {}, .needs = {}, .files = {}};
  RunningJob running(options, job, 1);
  while (!running.has_ended()) std::this_thread::yield();
  return running.state();
}

TEST(RunningJob, IsDoneOnlyWithItsResults) {
  const testing::ScratchDirectory scratch;
  const State failed = state_after_true(scratch);
  EXPECT_EQ(failed.progress, Progress::kFailed);
  EXPECT_NE(failed.reason.find("without its results, '" + (scratch / "a.mrc").string()),
            std::string::npos)
      << failed.reason;
  scratch.write("a.mrc", "");
  scratch.write("a.json", "");
  EXPECT_EQ(state_after_true(scratch).progress, Progress::kDone);
}

}  // namespace
}  // namespace tomofield::batch
