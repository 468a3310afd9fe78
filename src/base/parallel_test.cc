#include "base/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <string>
#include <vector>

namespace tomofield::base {
namespace {

class ParallelFor : public ::testing::TestWithParam<int> {
 protected:
  void SetUp() override { set_thread_count(GetParam()); }
  void TearDown() override { set_thread_count(0); }
};
INSTANTIATE_TEST_SUITE_P(Threads, ParallelFor, ::testing::Values(1, 2, 5));

TEST_P(ParallelFor, VisitsEachIndexOnce) {
  for (const std::int64_t count : {0, 1, 2, 7, 1000}) {
    std::vector<std::atomic<int>> visits(static_cast<std::size_t>(count));
    parallel_for("test", count, [&](std::int64_t i) { ++visits[static_cast<std::size_t>(i)]; });
    for (const auto& n : visits) ASSERT_EQ(n.load(), 1) << "of " << count;
  }
}

TEST_P(ParallelFor, ThreadsAreNumberedBelowTheCount) {
  EXPECT_EQ(thread_count(), GetParam());
  std::atomic<int> wrong{0};
  parallel_for("test", 500,
               [&](std::int64_t) { wrong += thread_index() < 0 || thread_index() >= GetParam(); });
  EXPECT_EQ(wrong.load(), 0);
}

TEST_P(ParallelFor, RethrowsWhatABodyThrows) {
  std::atomic<int> visits{0};
  const auto run = [&] {
    parallel_for("test", 100, [&](std::int64_t i) {
      ++visits;
      if (i == 37) throw std::runtime_error("thirty-seven");
    });
  };
  try {
    run();
    FAIL() << "the exception was lost";
  } catch (const std::runtime_error& error) {
    EXPECT_EQ(std::string(error.what()), "thirty-seven");
  }
  EXPECT_GT(visits.load(), 0);
  // The next loop must not see an exception of the last one.
  EXPECT_NO_THROW(parallel_for("test", 10, [](std::int64_t) {}));
}

TEST_P(ParallelFor, OneOfManyExceptionsArrives) {
  EXPECT_THROW(parallel_for("test", 64, [](std::int64_t i) { throw static_cast<int>(i); }), int);
}

TEST(ThreadCount, ZeroMeansAllOfTheMachine) {
  set_thread_count(3);
  EXPECT_EQ(thread_count(), 3);
  set_thread_count(0);
  EXPECT_GE(thread_count(), 1);
}

}  // namespace
}  // namespace tomofield::base
