#include "tilt_series/view_store.h"

#include <gtest/gtest.h>

#include <stdexcept>

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

}  // namespace
}  // namespace tomofield::tilt_series
