#include "compare/child_process.h"

#include <gtest/gtest.h>

#include <csignal>
#include <fstream>
#include <iterator>

#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::compare {
namespace {

class ChildProcess : public ::testing::Test {
 protected:
  ChildResult run(const char* script, const std::function<bool()>& stop = {}) {
    return run_child({"/bin/sh", "-c", script}, log_, stop);
  }
  std::string said() const {
    std::ifstream file(log_);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  testing::ScratchDirectory directory_;
  std::filesystem::path log_ = directory_.path() / "log";
};

TEST_F(ChildProcess, TellsItsStatusAndKeepsWhatItSaid) {
  EXPECT_EQ(run("echo out; echo err >&2; exit 7").exit_status, 7);
  EXPECT_EQ(said(), "out\nerr\n");
  EXPECT_EQ(run("kill -9 $$").exit_status, 128 + SIGKILL);
}

TEST_F(ChildProcess, MeasuresWhatItTook) {
  const ChildResult busy = run("i=0; while [ $i -lt 100000 ]; do i=$((i+1)); done");
  EXPECT_GT(busy.core_seconds, 0.01);
  EXPECT_GE(busy.wall_seconds, 0.5 * busy.core_seconds);
  EXPECT_GT(busy.peak_bytes, 100'000);
  EXPECT_LT(busy.peak_bytes, std::int64_t{1} << 30);
}

TEST_F(ChildProcess, IsStoppedOnRequest) {
  EXPECT_EQ(run("exec sleep 100", [] { return true; }).exit_status, 128 + SIGTERM);
}

TEST_F(ChildProcess, HasFailedForWhatItSaysInItsOwnName) {
  run("echo 'tomofield: no such file' >&2; echo plan");
  EXPECT_EQ(reason_of_failure(log_), "no such file");
  run("echo first; echo Killed; echo");
  EXPECT_EQ(reason_of_failure(log_), "Killed");
}

TEST_F(ChildProcess, ThatDoesNotExistIsAnError) {
  EXPECT_THROW(run_child({"/nowhere/program"}, log_, {}), Error);
}

}  // namespace
}  // namespace tomofield::compare
