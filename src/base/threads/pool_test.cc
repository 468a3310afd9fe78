#include "base/threads/pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <vector>

namespace tomofield::base {
namespace {

struct Counted {
  static inline std::atomic<int> made{0};
  Counted() { ++made; }
  std::atomic<int> users{0};
};

TEST(Pool, LendsAgainWhatCameBack) {
  Pool<std::vector<int>> pool;
  pool.borrow()->assign(3, 7);
  EXPECT_EQ(pool.borrow()->size(), 3u);
  const auto first = pool.borrow(), second = pool.borrow();
  EXPECT_EQ(first->size(), 3u);
  EXPECT_TRUE(second->empty());
  EXPECT_NE(first.get(), second.get());
}

TEST(Pool, LendsAnObjectToOneOfTheThreadsAtATime) {
  constexpr int kThreads = 4;
  set_thread_count(kThreads);
  Counted::made = 0;
  Pool<Counted> pool;
  std::atomic<int> shared{0};
  parallel_for("borrow", 2000, [&](std::int64_t) {
    const auto object = pool.borrow();
    shared += ++object->users > 1;
    --object->users;
  });
  set_thread_count(0);
  EXPECT_EQ(shared.load(), 0);
  EXPECT_LE(Counted::made.load(), kThreads);
}

}  // namespace
}  // namespace tomofield::base
