#include "tilt_series/view_store.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <stdexcept>
#include <utility>

#include "base/threads/parallel.h"
#include "scratch_directory.h"

namespace tomofield::tilt_series {
namespace {

MaskedImage some_view(float first) {
  MaskedImage image(7, 5);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    image.valid[i] = i % 3 != 0;
    image.values[i] = image.valid[i] ? first + static_cast<float>(i) : 0.0f;
  }
  return image;
}

TEST(ViewStore, ReturnsTheViewsThatItHolds) {
  const testing::ScratchDirectory scratch;
  ViewStore store(/*num_views=*/6, /*capacity=*/2, 7, 5, scratch.path());
  store.write(4, some_view(100));
  store.write(1, some_view(-200));
  for (const auto& [view, first] : {std::pair{4u, 100.0f}, {1u, -200.0f}}) {
    const MaskedImage read = store.read(view);
    EXPECT_EQ(read.values, some_view(first).values);
    EXPECT_EQ(read.valid, some_view(first).valid);
  }
  EXPECT_FALSE(store.holds(0));
  EXPECT_THROW(store.write(0, some_view(0)), std::logic_error) << "there is room for two";
  store.discard(4);
  EXPECT_FALSE(store.holds(4));
  EXPECT_THROW(store.read(4), std::logic_error);
  EXPECT_EQ(store.read(1).values, some_view(-200).values);
}

TEST(ViewStore, TakesViewsFromSeveralThreads) {
  const testing::ScratchDirectory scratch;
  constexpr std::size_t kViews = 200;
  ViewStore store(kViews, kViews, 7, 5, scratch.path());
  base::set_thread_count(4);
  base::parallel_for("write views", kViews, [&](std::int64_t view) {
    store.write(static_cast<std::size_t>(view), some_view(static_cast<float>(view)));
  });
  base::set_thread_count(0);
  for (std::size_t view = 0; view < kViews; ++view)
    ASSERT_EQ(store.read(view).values, some_view(static_cast<float>(view)).values);
}

}  // namespace
}  // namespace tomofield::tilt_series
