#include "base/threads/parallel.h"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "base/aligned_buffer.h"
#include "base/progress.h"
#include "base/system/processors.h"
#include "base/threads/stoppable_loops.h"

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

TEST_P(ParallelFor, AStopEndsALoopBeforeItsNextBody) {
  std::atomic<bool> is_asked{false};
  std::atomic<int> visits{0};
  set_loop_interruption([&] {
    if (is_asked) throw StopRequested{};
  });
  const auto run = [&] {
    parallel_for("test", 1000, [&](std::int64_t) {
      if (++visits == 10) is_asked = true;
    });
  };
  EXPECT_THROW(run(), StopRequested);
  EXPECT_LT(visits.load(), 10 + GetParam());
  set_loop_interruption({});
  is_asked = false;
  EXPECT_NO_THROW(run());
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

TEST_P(ParallelFor, ThreadThatWaitsForAnInnerLoopStartsNoOtherOuterIndex) {
  std::vector<std::atomic<int>> running(static_cast<std::size_t>(GetParam()));
  std::atomic<int> shared{0}, inner_calls{0};
  parallel_for("outer", 40, [&](std::int64_t) {
    std::atomic<int>& here = running[static_cast<std::size_t>(thread_index())];
    shared += here++ > 0;
    parallel_for("inner", 20, [&](std::int64_t) { ++inner_calls; });
    --here;
  });
  EXPECT_EQ(shared.load(), 0);
  EXPECT_EQ(inner_calls.load(), 40 * 20);
}

TEST_P(ParallelFor, ExceptionOfAnInnerLoopReachesTheCaller) {
  const auto run = [] {
    parallel_for("outer", 8, [](std::int64_t i) {
      parallel_for("inner", 8, [i](std::int64_t j) {
        if (i == 3 && j == 5) throw std::runtime_error("inner");
      });
    });
  };
  EXPECT_THROW(run(), std::runtime_error);
}

class DescribedThreads : public ::testing::Test {
 protected:
  void TearDown() override {
    unsetenv("OMP_NUM_THREADS");
    share_machine_with(1);
    set_thread_count(0);
  }
  static bool says(const std::string& text) {
    return describe_threads().find(text) != std::string::npos;
  }
};

TEST_F(DescribedThreads, NumberThatWasAskedFor) {
  setenv("OMP_NUM_THREADS", "7", 1);  // counts less
  set_thread_count(3);
  EXPECT_TRUE(says("3 threads, as asked for; ")) << describe_threads();
  set_thread_count(1);
  EXPECT_TRUE(says("1 thread, as asked for; not bound to processors, since "))
      << describe_threads();
}

TEST_F(DescribedThreads, NumberOfTheEnvironment) {
  setenv("OMP_NUM_THREADS", "5", 1);
  set_thread_count(0);
  EXPECT_EQ(thread_count(), 5);
  EXPECT_TRUE(says("5 threads, as OMP_NUM_THREADS says; ")) << describe_threads();
}

TEST_F(DescribedThreads, HugeNumbersOfTheEnvironmentAreCut) {
  for (const char* text : {"99999999", "1000000000000000000000000"}) {
    setenv("OMP_NUM_THREADS", text, 1);
    set_thread_count(0);
    EXPECT_LE(thread_count(), kMostThreads) << text;
    EXPECT_TRUE(says("the most there can be, since OMP_NUM_THREADS says 9")) << describe_threads();
  }
}

TEST_F(DescribedThreads, NumbersThatAreNoneDoNotCount) {
  set_thread_count(0);
  const int usual = thread_count();
  for (const char* text : {"", "0", "-2", "many"}) {
    setenv("OMP_NUM_THREADS", text, 1);
    set_thread_count(0);
    EXPECT_EQ(thread_count(), usual) << text;
  }
}

TEST_F(DescribedThreads, ProcessesOfAJobShareTheMachine) {
  if (!processors_of_this_process().are_all_usable())
    GTEST_SKIP() << "this process may not use the whole machine";
  share_machine_with(100000);
  EXPECT_EQ(thread_count(), 1);
  EXPECT_TRUE(says("1 thread, the share of each of 100000 processes on this machine"))
      << describe_threads();
  EXPECT_TRUE(says("not bound to processors, since it shares the machine")) << describe_threads();
}

#if defined(__has_feature)
#if __has_feature(thread_sanitizer)
// The way in which indices pass from thread to thread must not hide races of bodies.
void run_a_race(bool is_in_inner_loop) {
  set_thread_count(2);
  std::int64_t sum = 0;
  const auto add = [&](std::int64_t i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    sum += i;
  };
  for (int round = 0; round < 20; ++round) {
    if (is_in_inner_loop)
      parallel_for("outer", 2, [&](std::int64_t) { parallel_for("inner", 2, add); });
    else
      parallel_for("race", 2, add);
  }
  std::exit(0);
}

TEST(ThreadSanitizer, FindsRacesOfTasks) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  constexpr int kStatusOfReports = 66;
  for (const bool is_in_inner_loop : {false, true}) {
    EXPECT_EXIT(run_a_race(is_in_inner_loop), ::testing::ExitedWithCode(kStatusOfReports),
                "data race.*parallel_test");
  }
}
#endif
#endif

TEST(ThreadCount, ZeroMeansAllOfTheMachine) {
  set_thread_count(3);
  EXPECT_EQ(thread_count(), 3);
  set_thread_count(0);
  EXPECT_GE(thread_count(), 1);
}

// Two callers have number 0 both, so neither may help in the other one's loop.
TEST(ParallelLoops, ThreadsOfALoopHaveDifferentNumbersBesideOtherCallers) {
  set_thread_count(3);
  std::atomic<int> doubled{0};
  const auto call = [&] {
    for (int repeat = 0; repeat < 50; ++repeat) {
      std::vector<std::atomic<int>> users(3);
      parallel_for("numbers", 24, [&](std::int64_t) {
        const auto number = static_cast<std::size_t>(thread_index());
        doubled += ++users[number] > 1;
        std::this_thread::sleep_for(std::chrono::microseconds(50));
        --users[number];
      });
    }
  };
  std::thread other(call);
  call();
  other.join();
  set_thread_count(0);
  EXPECT_EQ(doubled.load(), 0);
}

// Two threads have half of the indices each, and take others only when they have none left.
TEST(ParallelLoops, AnIndexMeetsTheThreadOfTheLastTime) {
  set_thread_count(2);
  constexpr int kCount = 16, kRepeats = 40;
  std::vector<int> last(kCount, -1);
  std::atomic<int> same{0};
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    parallel_for("affinity", kCount, [&](std::int64_t i) {
      std::this_thread::sleep_for(std::chrono::microseconds(100));
      int& thread = last[static_cast<std::size_t>(i)];
      same += thread == thread_index();
      thread = thread_index();
    });
  }
  set_thread_count(0);
  EXPECT_GT(same.load(), kCount * (kRepeats - 1) * 3 / 4);
}

// Returns the NUMA node on which a page lies, or a negative error.
int node_of(void* page) {
  int node = -1;
  if (syscall(SYS_move_pages, 0, 1UL, &page, nullptr, &node, 0) != 0) return -errno;
  return node;
}

TEST(ParallelLoops, APageLiesOnTheNodeOfTheThreadThatWritesItFirst) {
  constexpr std::size_t kBytes = std::size_t{2} << 20, kCount = 32;
  AlignedBuffer<char> buffer(kBytes * kCount);
  if (node_of(buffer.data()) != -ENOENT) GTEST_SKIP() << "the system does not say where pages lie";
  set_thread_count(4);
  std::vector<unsigned> node(kCount);
  parallel_for("touch", kCount, [&](std::int64_t i) {
    unsigned before = 0, after = 1;
    while (before != after) {  // until the thread stays on its node meanwhile
      getcpu(nullptr, &before);
      buffer[static_cast<std::size_t>(i) * kBytes] = 1;
      getcpu(nullptr, &after);
    }
    node[static_cast<std::size_t>(i)] = before;
  });
  set_thread_count(0);
  for (std::size_t i = 0; i < kCount; ++i)
    EXPECT_EQ(node_of(&buffer[i * kBytes]), static_cast<int>(node[i])) << i;
}

TEST(Parallel, TheNumberOfThreadsStaysWhileTheyAreUsed) {
  set_thread_count(2);
  {
    const ThreadsInUse used, also;
    EXPECT_THROW(set_thread_count(3), Error);
    EXPECT_EQ(thread_count(), 2);
  }
  set_thread_count(3);
  EXPECT_EQ(thread_count(), 3);
  set_thread_count(0);
}

TEST(Parallel, LoopsOfAThreadStopWhereTheyMay) {
  std::atomic<int> calls = 0;
  const auto run = [&] { parallel_for("count", 1000, [&](std::int64_t) { ++calls; }); };
  {
    const StoppableLoops loops([&] { return calls > 10; });
    EXPECT_THROW(run(), StopRequested);
    EXPECT_LT(calls, 1000);
  }
  calls = 0;
  run();  // may not stop any more
  EXPECT_EQ(calls, 1000);
}

}  // namespace
}  // namespace tomofield::base
