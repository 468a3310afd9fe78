#include "io/saving/scratch_memory.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <vector>

#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

constexpr std::size_t kPage = 4096, kBytes = 10 * kPage + 17;

void fill(ScratchMemory& memory, std::byte value) {
  memory.write(0, std::vector<std::byte>(kBytes, value));
}

void expect_keeps_values(ScratchMemory memory) {
  for (std::size_t i = 0; i < kBytes; ++i) ASSERT_EQ(memory.data()[i], std::byte{0}) << i;
  fill(memory, std::byte{7});
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
  ScratchMemory memory(kBytes, "the bytes", "/tmp");
  fill(memory, std::byte{7});
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

// A limit of the address space is no full disk.
TEST(ScratchMemory, ThatCannotBeMappedIsNoFaultOfTheDisk) {
  const testing::ScratchDirectory scratch;
  constexpr std::size_t kLarge = std::size_t{1} << 28;
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const auto fault = [&] {
    constexpr rlim_t kMore = std::size_t{1} << 26;
    struct rlimit limit {};
    getrlimit(RLIMIT_AS, &limit);
    std::size_t used_pages = 0;
    std::ifstream("/proc/self/statm") >> used_pages;
    limit.rlim_cur = used_pages * kPage + kMore;
    setrlimit(RLIMIT_AS, &limit);
    try {
      const ScratchMemory memory(kLarge, "the bytes", scratch.path(), /*in_memory_bytes=*/0);
    } catch (const Error& error) {
      std::fputs(error.what(), stderr);
      std::_Exit(2);
    }
    std::_Exit(0);
  };
  EXPECT_EXIT(fault(), ::testing::ExitedWithCode(2), "not enough memory for the bytes.*ulimit -v");
}

// Lets files of this process be no larger than some bytes for as long as it lives.
class LimitOfFiles {
 public:
  explicit LimitOfFiles(rlim_t bytes) : old_handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &old_);
    const rlimit limit{bytes, old_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~LimitOfFiles() {
    setrlimit(RLIMIT_FSIZE, &old_);
    std::signal(SIGXFSZ, old_handler_);
  }
  LimitOfFiles(const LimitOfFiles&) = delete;
  LimitOfFiles& operator=(const LimitOfFiles&) = delete;

 private:
  rlimit old_{};
  void (*old_handler_)(int);
};

TEST(ScratchMemory, AFileThatCannotBeWrittenAfterAllThrowsAndEndsNoProcess) {
  const testing::ScratchDirectory scratch;
  ScratchMemory memory(kBytes, "the bytes", scratch.path(), /*in_memory_bytes=*/0);
  const LimitOfFiles limit(kPage);
  const std::string message = testing::message_of<Error>([&] { fill(memory, std::byte{7}); });
  EXPECT_NE(message.find(scratch.path().string()), std::string::npos) << message;
  EXPECT_NE(message.find("less room than it said"), std::string::npos) << message;
  EXPECT_EQ(memory.data()[kPage - 1], std::byte{7}) << "what was written can be read";
}

TEST(ScratchMemory, AFolderThatIsNotThereIsNamed) {
  const std::string message = testing::message_of<Error>(
      [] { ScratchMemory(kBytes, "the bytes", "/no/such/folder", /*in_memory_bytes=*/0); });
  EXPECT_NE(message.find("/no/such/folder"), std::string::npos) << message;
  EXPECT_NE(message.find("the bytes need"), std::string::npos) << message;
}

}  // namespace
}  // namespace tomofield::io
