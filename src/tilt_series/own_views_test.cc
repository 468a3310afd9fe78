#include "tilt_series/own_views.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <numeric>
#include <thread>
#include <vector>

namespace tomofield::tilt_series {
namespace {

TEST(ViewsAtOnce, IsAtLeastOneAndFewerIfTheyAreLarger) {
  const auto& alone = distributed::Communicator::alone();
  EXPECT_EQ(views_at_once(std::size_t{1} << 60, alone), 1u);
  const std::size_t small = views_at_once(std::size_t{1} << 20, alone);
  EXPECT_GE(small, 1024u) << "a gibibyte";
  EXPECT_LT(views_at_once(std::size_t{1} << 24, alone), small);
}

TEST(ForViews, VisitsEveryViewAndNoMoreThanFitAtATime) {
  base::set_thread_count(4);
  std::vector<std::size_t> views(23);
  std::iota(views.begin(), views.end(), std::size_t{5});
  for (const std::size_t at_once : {1u, 2u, 3u, 100u}) {
    std::vector<std::atomic<int>> visits(40);
    std::atomic<int> now = 0, most = 0;
    for_views("views", views, at_once, [&](std::size_t view) {
      const int here = ++now;
      for (int known = most; known < here && !most.compare_exchange_weak(known, here);) continue;
      ++visits[view];
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      --now;
    });
    for (std::size_t view = 0; view < visits.size(); ++view)
      EXPECT_EQ(visits[view], view >= 5 && view < 28 ? 1 : 0) << view;
    EXPECT_LE(most, static_cast<int>(at_once));
  }
  base::set_thread_count(0);
}

}  // namespace
}  // namespace tomofield::tilt_series
