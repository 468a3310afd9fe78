#include "batch/packing.h"

#include <gtest/gtest.h>

#include <string>

namespace tomofield::batch {
namespace {

constexpr std::int64_t kGibibyte = std::int64_t{1} << 30;

Job job(double core_seconds, std::int64_t GiB, std::int64_t GiB_a_thread = 0) {
  Job made;
  made.needs = {.memory_bytes_of_one_thread = GiB * kGibibyte,
                .memory_bytes_a_thread = GiB_a_thread * kGibibyte,
                .core_seconds = core_seconds,
                .sample_steps = core_seconds,
                .result_bytes = 0,
                .disk_bytes = 0};
  return made;
}

// Describes starts as "job:threads job:threads".
std::string starts(const std::vector<Job>& jobs, const Room& room, bool nothing_runs = true) {
  std::string text;
  for (const Start& start : choose_starts(jobs, largest_first(jobs), room, nothing_runs))
    text +=
        (text.empty() ? "" : " ") + std::to_string(start.job) + ":" + std::to_string(start.threads);
  return text;
}

TEST(Packing, TheLargestGoFirst) {
  std::vector<Job> jobs{job(10, 1), job(30, 1), job(20, 1), job(30, 2)};
  EXPECT_EQ(largest_first(jobs), (std::vector<std::size_t>{3, 1, 2, 0}));
  jobs[1].is_skipped = true;
  EXPECT_EQ(largest_first(jobs), (std::vector<std::size_t>{3, 2, 0}));
}

TEST(Packing, ThreadsAreDividedAmongAllThatFit) {
  const std::vector<Job> jobs{job(3, 1), job(2, 1), job(1, 1)};
  EXPECT_EQ(starts(jobs, {8, 100 * kGibibyte, 10}), "0:3 1:3 2:2");
  EXPECT_EQ(starts(jobs, {2, 100 * kGibibyte, 10}), "0:1 1:1");
  EXPECT_EQ(starts(jobs, {8, 100 * kGibibyte, 1}), "0:8");
  EXPECT_EQ(starts(jobs, {8, 2 * kGibibyte, 10}), "0:4 1:4");
  EXPECT_EQ(starts(jobs, {0, 100 * kGibibyte, 10}, false), "");
}

TEST(Packing, ALargeJobLetsSmallOnesPass) {
  const std::vector<Job> jobs{job(9, 8), job(3, 2), job(2, 1)};
  EXPECT_EQ(starts(jobs, {4, 3 * kGibibyte, 10}, false), "1:2 2:2");
}

TEST(Packing, MemoryOfThreadsCounts) {
  const std::vector<Job> jobs{job(9, 2, 1), job(8, 2, 1)};
  EXPECT_EQ(starts(jobs, {4, 6 * kGibibyte, 10}), "0:2 1:2");  // 3 GiB each
  EXPECT_EQ(starts(jobs, {4, 5 * kGibibyte, 10}), "0:4");
}

TEST(Packing, OneStartsIfNothingRuns) {
  const std::vector<Job> jobs{job(9, 8), job(3, 7)};
  EXPECT_EQ(starts(jobs, {4, kGibibyte, 10}), "0:1");
  EXPECT_EQ(starts(jobs, {4, kGibibyte, 10}, false), "");
}

TEST(Packing, TheTimeOfAllFollowsFromThePacking) {
  const std::vector<Job> jobs{job(8, 1), job(4, 1), job(4, 1)};
  const auto all = largest_first(jobs);
  EXPECT_DOUBLE_EQ(seconds_of_all(jobs, all, {2, 100 * kGibibyte, 10}).value(), 8);
  EXPECT_DOUBLE_EQ(seconds_of_all(jobs, all, {2, kGibibyte, 10}).value(),
                   8);  // one after another on both
  EXPECT_DOUBLE_EQ(seconds_of_all(jobs, all, {1, 100 * kGibibyte, 10}).value(), 16);
  EXPECT_EQ(seconds_of_all(jobs, {}, {2, kGibibyte, 10}), 0);
  std::vector<Job> unknown = jobs;
  unknown[1].needs.core_seconds.reset();
  EXPECT_FALSE(seconds_of_all(unknown, all, {2, kGibibyte, 10}).has_value());
}

}  // namespace
}  // namespace tomofield::batch
