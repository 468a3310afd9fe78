#include "base/threads/fork_safe_mutex.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <mutex>
#include <thread>
#include <vector>

namespace tomofield::base {
namespace {

TEST(ForkSafeMutex, IsHeldByOneThreadAtATime) {
  constexpr int kThreads = 4, kTimes = 20000;
  ForkSafeMutex mutex;
  int count = 0;
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < kTimes; ++i) {
        const std::lock_guard lock(mutex);
        ++count;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(count, kThreads * kTimes);
}

TEST(ForkSafeMutex, AForkedProcessFindsItFree) {
  constexpr int kPatience_s = 20, kUnlocked = 7;
  ForkSafeMutex mutex;
  const std::lock_guard held(mutex);
  const pid_t child = fork();
  if (child == 0) {
    alarm(kPatience_s);
    for (int times = 0; times < 2; ++times) const std::lock_guard lock(mutex);
    _exit(kUnlocked);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), kUnlocked);
}

}  // namespace
}  // namespace tomofield::base
