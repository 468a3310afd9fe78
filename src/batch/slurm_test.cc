#include "batch/slurm.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <string>
#include <string_view>

#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::batch {
namespace {

Job job(double core_seconds, std::int64_t MiB) {
  Job made;
  made.needs.memory_bytes_of_one_thread = MiB << 20;
  made.needs.core_seconds = core_seconds;
  return made;
}

TEST(SlurmScript, HasATaskForEveryJobAndRoomForTheLargest) {
  std::vector<Job> jobs{job(60, 1000), job(4 * 3600, 500), job(1e6, 9000)};
  jobs[2].is_skipped = true;
  jobs[2].needs = {};
  const std::string script = slurm_script(
      {.program = "/opt/it's/tomofield", .folder = "/data/out", .threads = 4, .more = {"--mem=1G"}},
      jobs);
  EXPECT_NE(script.find("#SBATCH --array=1,2\n"), std::string::npos) << script;
  EXPECT_NE(script.find("#SBATCH --cpus-per-task=4\n"), std::string::npos) << script;
  EXPECT_NE(script.find("#SBATCH --mem=1456M\n"), std::string::npos) << script;
  EXPECT_NE(script.find("#SBATCH --time=195\n"), std::string::npos) << script;
  EXPECT_LT(script.find("--mem=1456M"), script.find("--mem=1G"));  // sbatch takes the last
  EXPECT_NE(script.find("exec '/opt/it'\\''s/tomofield' batch '/data/out/batch.json'"),
            std::string::npos)
      << script;
}

TEST(SlurmScript, NeedsALimitForJobsOfUnknownTime) {
  std::vector<Job> jobs{job(60, 1000), job(0, 500)};
  jobs[1].needs.core_seconds.reset();
  EXPECT_THROW(slurm_script({.program = "p", .folder = "/data", .more = {"--mem=1G"}}, jobs),
               Error);
  const std::string script = slurm_script(
      {.program = "p", .folder = "/data", .more = {"--partition=cpu --time=4:00:00"}}, jobs);
  EXPECT_EQ(script.find("--time="), script.find("--time=4:00:00")) << script;
  jobs[1].is_skipped = true;
  EXPECT_NO_THROW(slurm_script({.program = "p", .folder = "/data", .more = {}}, jobs));
}

TEST(SlurmScript, NeedsAFolderThatSbatchCanRead) {
  EXPECT_THROW(
      slurm_script({.program = "p", .folder = "/data/my results", .more = {}}, {job(1, 1)}), Error);
}

TEST(SlurmScript, HasNoLineThatANameMade) {
  const std::string usual =
      slurm_script({.program = "p", .folder = "/data", .more = {}}, {job(1, 1)});
  const auto num_lines = std::ranges::count(usual, '\n');
  for (int c = 1; c < 256; ++c) {
    const std::string name = "/data/a" + std::string(1, static_cast<char>(c)) + "b";
    std::string script;
    try {
      script = slurm_script({.program = name, .folder = name, .more = {}}, {job(1, 1)});
    } catch (const Error&) {
      EXPECT_TRUE(c <= ' ' || c == 0x7f ||
                  std::string_view("\"'\\%#").find(char(c)) != std::string::npos)
          << c;
      continue;
    }
    EXPECT_EQ(std::ranges::count(script, '\n'), num_lines) << c << script;
  }
  EXPECT_THROW(
      slurm_script({.program = "p", .folder = "/data", .more = {"--mem=1G\nrm x"}}, {job(1, 1)}),
      Error);
  for (const char* own : {"--signal=B:USR1@600", "--output=x", "--array=1-2%1", "-n 2", "--wrap=x",
                          "-a1-3", "--arr=1", "--time=5 --test-only", "-d afterok:1", "--out x"})
    EXPECT_THROW(slurm_script({.program = "p", .folder = "/data", .more = {own}}, {job(1, 1)}),
                 Error)
        << own;
  for (const char* other : {"--ntasks-per-node=1", "-p cpu --nodelist=n1", "--open-mode=append"})
    EXPECT_NO_THROW(slurm_script({.program = "p", .folder = "/data", .more = {other}}, {job(1, 1)}))
        << other;
}

// Sets variables of the environment for one test.
class SlurmGrantTest : public ::testing::Test {
 protected:
  SlurmGrantTest() { clear(); }
  ~SlurmGrantTest() override { clear(); }
  static void clear() {
    for (const char* name :
         {"SLURM_JOB_ID", "SLURM_CPUS_PER_TASK", "SLURM_MEM_PER_NODE", "SLURM_MEM_PER_CPU"})
      ::unsetenv(name);
  }
};

TEST_F(SlurmGrantTest, IsThatOfTheJob) {
  ::setenv("SLURM_CPUS_PER_TASK", "6", 1);
  EXPECT_FALSE(slurm_grant().threads.has_value()) << "there is no job";
  ::setenv("SLURM_JOB_ID", "7", 1);
  EXPECT_EQ(slurm_grant().threads, 6);
  EXPECT_FALSE(slurm_grant().memory_bytes.has_value());
  ::setenv("SLURM_MEM_PER_CPU", "100", 1);
  EXPECT_EQ(slurm_grant().memory_bytes, std::int64_t{600} << 20);
  ::setenv("SLURM_MEM_PER_NODE", "2000", 1);
  EXPECT_EQ(slurm_grant().memory_bytes, std::int64_t{2000} << 20);
  ::setenv("SLURM_CPUS_PER_TASK", "many", 1);
  EXPECT_FALSE(slurm_grant().threads.has_value());
}

TEST_F(SlurmGrantTest, HasNoNumbersThatNoMachineHas) {
  ::setenv("SLURM_JOB_ID", "7", 1);
  ::setenv("SLURM_CPUS_PER_TASK", "2147483648", 1);
  ::setenv("SLURM_MEM_PER_NODE", "9223372036854775807", 1);
  EXPECT_FALSE(slurm_grant().threads.has_value());
  EXPECT_FALSE(slurm_grant().memory_bytes.has_value());
  ::unsetenv("SLURM_MEM_PER_NODE");
  ::setenv("SLURM_CPUS_PER_TASK", "1000000", 1);
  ::setenv("SLURM_MEM_PER_CPU", "1000000000000", 1);  // 10²⁴ bytes in all
  EXPECT_FALSE(slurm_grant().memory_bytes.has_value());
}

}  // namespace
}  // namespace tomofield::batch
