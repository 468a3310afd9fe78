#include "io/saving/scratch_memory.h"

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <utility>

#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

constexpr std::size_t kPage = 4096, kBytes = 10 * kPage + 17;

void expect_keeps_values(const ScratchMemory& memory) {
  for (std::size_t i = 0; i < kBytes; ++i) ASSERT_EQ(memory.data()[i], std::byte{0}) << i;
  std::memset(memory.data(), 7, kBytes);
  memory.release(0, kBytes);
  for (std::size_t i = 0; i < kBytes; ++i) ASSERT_EQ(memory.data()[i], std::byte{7}) << i;
  memory.discard(kPage, 2 * kPage);
  for (std::size_t i = 0; i < kBytes; ++i) {
    if (i < kPage || i >= 3 * kPage) {
      ASSERT_EQ(memory.data()[i], std::byte{7}) << i;
    }
  }
}

TEST(ScratchMemory, KeepsWhatIsReleasedAndNotDiscarded) {
  const testing::ScratchDirectory scratch;
  expect_keeps_values(ScratchMemory(kBytes, "the bytes", scratch.path()));
  expect_keeps_values(ScratchMemory(kBytes, "the bytes", scratch.path(), /*in_memory_bytes=*/0));
}

TEST(ScratchMemory, DiscardedMemoryIsReturned) {
  const ScratchMemory memory(kBytes, "the bytes", "/tmp");
  std::memset(memory.data(), 7, kBytes);
  memory.discard(kPage + 1, 3 * kPage);
  EXPECT_EQ(memory.data()[kPage + 1], std::byte{7}) << "the page has another part";
  for (std::size_t i = 2 * kPage; i < 4 * kPage; ++i) ASSERT_EQ(memory.data()[i], std::byte{0});
}

TEST(ScratchMemory, LeavesNoFile) {
  const testing::ScratchDirectory scratch;
  {
    const ScratchMemory memory(kBytes, "the bytes", scratch.path(), /*in_memory_bytes=*/0);
    EXPECT_TRUE(std::filesystem::is_empty(scratch.path()));
  }
  EXPECT_TRUE(std::filesystem::is_empty(scratch.path()));
}

TEST(ScratchMemory, AFolderThatIsNotThereIsNamed) {
  const std::string message = testing::message_of<Error>(
      [] { ScratchMemory(kBytes, "the bytes", "/no/such/folder", /*in_memory_bytes=*/0); });
  EXPECT_NE(message.find("/no/such/folder"), std::string::npos) << message;
  EXPECT_NE(message.find("the bytes need"), std::string::npos) << message;
}

}  // namespace
}  // namespace tomofield::io
