#include "base/aligned_buffer.h"

#include <gtest/gtest.h>
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <numeric>
#include <utility>

namespace tomofield::base {
namespace {

template <typename T>
std::uintptr_t address(const AlignedBuffer<T>& buffer) {
  return reinterpret_cast<std::uintptr_t>(buffer.data());
}

template <typename T>
bool is_zero(const AlignedBuffer<T>& buffer) {
  return std::all_of(buffer.begin(), buffer.end(), [](T x) { return x == T{}; });
}

TEST(AlignedBuffer, IsAlignedAndZeroForAnySize) {
  for (const std::size_t size : {1u, 3u, 16u, 17u, 1000u, 4097u}) {
    AlignedBuffer<float> buffer(size);
    EXPECT_EQ(buffer.size(), size);
    EXPECT_EQ(address(buffer) % 64, 0u) << size;
    EXPECT_TRUE(is_zero(buffer)) << size;
  }
}

TEST(AlignedBuffer, LargeOnesAreAlignedForHugePages) {
  constexpr std::size_t kHugePage = std::size_t{2} << 20;
  for (const std::size_t bytes : {2 * kHugePage, 2 * kHugePage + 12}) {
    AlignedBuffer<float> buffer(bytes / sizeof(float));
    EXPECT_EQ(address(buffer) % kHugePage, 0u);
    EXPECT_TRUE(is_zero(buffer));
  }
}

// Returns the memory that the program occupies now, in bytes.
std::size_t resident_bytes() {
  std::ifstream file("/proc/self/statm");
  std::size_t size = 0, resident = 0;
  file >> size >> resident;
  return resident * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

TEST(AlignedBuffer, PagesThatAreNotWrittenTakeNoMemory) {
  constexpr std::size_t kMiB = std::size_t{1} << 20;
  const std::size_t before = resident_bytes();
  AlignedBuffer<float> buffer(512 * kMiB / sizeof(float));
  buffer[buffer.size() / 2] = 1.0f;
  EXPECT_LT(resident_bytes(), before + 16 * kMiB);
}

// Heap memory must not be unmapped, because it may lie in the middle of a mapped region.
TEST(AlignedBuffer, ASmallOneInPlaceOfALargeOneIsFreed) {
  constexpr std::size_t kLarge = std::size_t{2} << 20, kSmall = 20000;
  const std::size_t before = mallinfo2().uordblks;
  for (int i = 0; i < 100; ++i) {
    AlignedBuffer<float> buffer(kLarge);
    buffer.reset(kSmall);
  }
  EXPECT_LT(mallinfo2().uordblks, before + 10 * kSmall * sizeof(float));
}

TEST(AlignedBuffer, EmptyHasNoElements) {
  AlignedBuffer<double> none, zero(0);
  EXPECT_TRUE(none.empty());
  EXPECT_TRUE(zero.empty());
  EXPECT_EQ(zero.begin(), zero.end());
  zero.fill(3.0);  // must not write anything
}

TEST(AlignedBuffer, ResetForgetsAndReserveOnlyGrows) {
  AlignedBuffer<float> buffer(10);
  std::iota(buffer.begin(), buffer.end(), 1.0f);
  const float* const before = buffer.data();
  buffer.reserve(5);
  EXPECT_EQ(buffer.data(), before);
  EXPECT_EQ(buffer.size(), 10u);
  EXPECT_EQ(buffer[9], 10.0f);
  buffer.reserve(100);
  EXPECT_EQ(buffer.size(), 100u);
  buffer.fill(2.0f);
  EXPECT_EQ(buffer[99], 2.0f);
  buffer.reset(100);
  EXPECT_TRUE(is_zero(buffer));
  buffer.reset(4);
  EXPECT_EQ(buffer.size(), 4u);
}

TEST(AlignedBuffer, MovesWithoutCopying) {
  AlignedBuffer<float> from(8);
  from[3] = 7.0f;
  const float* const data = from.data();
  AlignedBuffer<float> to = std::move(from);
  EXPECT_EQ(to.data(), data);
  EXPECT_EQ(to[3], 7.0f);
  std::span<const float> view = std::as_const(to);
  EXPECT_EQ(view.size(), 8u);
}

}  // namespace
}  // namespace tomofield::base
