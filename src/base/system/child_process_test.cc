#include "base/system/child_process.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <iterator>
#include <string>

#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::base {
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
  EXPECT_GT(busy.costs.core_seconds, 0.01);
  EXPECT_GE(busy.costs.wall_seconds, 0.5 * busy.costs.core_seconds);
  EXPECT_GT(busy.costs.peak_bytes, 100'000);
  EXPECT_LT(busy.costs.peak_bytes, std::int64_t{1} << 30);
}

TEST_F(ChildProcess, IsStoppedOnRequest) {
  EXPECT_EQ(run("exec sleep 100", [] { return true; }).exit_status, 128 + SIGTERM);
}

// Returns true for a process that runs, and not for one that nobody has waited for yet.
bool is_alive(::pid_t process) {
  std::ifstream status(fmt::format("/proc/{}/stat", process));
  std::string number, name, state;
  return status >> number >> name >> state && state != "Z";
}

// Returns true if a process ends within some seconds.
bool ends(::pid_t process) {
  for (int i = 0; i < 500 && is_alive(process); ++i) ::usleep(20'000);
  return !is_alive(process);
}

TEST_F(ChildProcess, EndsWithItsParent) {
  for (const int signal : {SIGKILL, SIGTERM, SIGINT}) {
    std::filesystem::remove(directory_ / "id");
    const ::pid_t parent = ::fork();
    if (parent == 0) {
      ::signal(signal, SIG_DFL);
      run(fmt::format("echo $$ > {0}.part; mv {0}.part {0}; exec sleep 100",
                      (directory_ / "id").string())
              .c_str());
      ::_exit(0);
    }
    while (!std::filesystem::exists(directory_ / "id")) ::usleep(1000);
    ::pid_t child = 0;
    std::ifstream(directory_ / "id") >> child;
    ASSERT_GT(child, 0);
    ::kill(parent, signal);
    ::waitpid(parent, nullptr, 0);
    EXPECT_TRUE(ends(child)) << signal;
  }
}

TEST_F(ChildProcess, HasFailedForWhatItSaysInItsOwnName) {
  run("echo 'tomofield: no such file' >&2; echo plan");
  EXPECT_EQ(reason_of_failure(log_), "no such file");
  run("echo first; echo Killed; echo");
  EXPECT_EQ(reason_of_failure(log_), "Killed");
}

TEST_F(ChildProcess, HasAReasonEvenIfItWasKilledOrSaidNothing) {
  const auto reason = [&](const char* script) {
    return reason_of_failure(run(script).exit_status, log_);
  };
  EXPECT_EQ(reason("echo 'tomofield: no such file' >&2; exit 2"), "no such file");
  EXPECT_NE(reason("echo 3 of 4; kill -KILL $$").find("killed"), std::string::npos);
  const std::string stopped = reason("echo 3 of 4; kill -ABRT $$");
  for (const char* part : {"signal 6", "3 of 4"})
    EXPECT_NE(stopped.find(part), std::string::npos) << stopped;
  EXPECT_NE(reason("kill -ABRT $$").find("said nothing"), std::string::npos);
  EXPECT_NE(reason("exit 3").find("status 3"), std::string::npos);
}

TEST_F(ChildProcess, ThatDoesNotExistIsAnError) {
  EXPECT_THROW(run_child({"/nowhere/program"}, log_, {}), Error);
}

TEST(Costs, OfSessionsAddUpButForMemory) {
  const Costs sum = Costs{1, 2, 300} + Costs{10, 20, 200};
  EXPECT_EQ(sum.core_seconds, 11);
  EXPECT_EQ(sum.wall_seconds, 22);
  EXPECT_EQ(sum.peak_bytes, 300);
}

}  // namespace
}  // namespace tomofield::base
