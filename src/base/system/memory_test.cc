#include "base/system/memory.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::base {
namespace {

namespace fs = std::filesystem;
using testing::message_of;
using testing::ScratchDirectory;

constexpr std::size_t kMebibyte = 1 << 20;

// Stands for the root of a file system with 8 GiB of free memory and the files of control groups.
class FakeRoot {
 public:
  explicit FakeRoot(const std::string& groups_of_process) {
    write("proc/self/cgroup", groups_of_process);
    write("proc/meminfo", "MemTotal:  16000000 kB\nMemAvailable:    8388608 kB\nBuffers: 1 kB\n");
  }
  FakeRoot& write(const fs::path& file, const std::string& text) {
    fs::create_directories(directory_.path() / file.parent_path());
    directory_.write(file.string(), text);
    return *this;
  }
  FakeRoot& group(const std::string& path, const std::string& file, const std::string& text) {
    return write(fs::path("sys/fs/cgroup") / path / file, text);
  }
  std::size_t mebibytes() const { return find_available_memory(path())->bytes / kMebibyte; }
  bool is_limited() const { return find_available_memory(path())->is_limited_by_group; }
  const fs::path& path() const { return directory_.path(); }

 private:
  ScratchDirectory directory_;
};

std::string bytes(std::size_t mebibytes) { return std::to_string(mebibytes * kMebibyte) + "\n"; }

TEST(Memory, ASystemThatSaysNothingHasNoLimit) {
  const ScratchDirectory empty;
  EXPECT_FALSE(find_available_memory(empty.path()));
  require_memory(std::size_t{1} << 60, "the fit", "a larger --bin", empty.path());
}

TEST(Memory, WithoutALimitTheMachineCounts) {
  FakeRoot root("0::/user.slice\n");
  EXPECT_EQ(root.mebibytes(), 8192u);
  root.group("user.slice", "memory.max", "max\n");
  EXPECT_EQ(root.mebibytes(), 8192u);
  EXPECT_FALSE(root.is_limited());
  root.group("user.slice", "memory.max", bytes(100000));  // more than the machine has
  EXPECT_EQ(root.mebibytes(), 8192u);
}

TEST(Memory, Version2LeavesItsLimitMinusWhatIsUsed) {
  FakeRoot root("0::/job/step\n");
  root.group("job/step", "memory.max", bytes(1000));
  EXPECT_EQ(root.mebibytes(), 1000u);
  EXPECT_TRUE(root.is_limited());
  root.group("job/step", "memory.current", bytes(400));
  EXPECT_EQ(root.mebibytes(), 600u);
  // Cached files make room.
  root.group("job/step", "memory.stat",
             "anon 5\ninactive_file " + bytes(100) + "active_file " + bytes(50));
  EXPECT_EQ(root.mebibytes(), 750u);
  root.group("job/step", "memory.current", bytes(2000));
  EXPECT_EQ(root.mebibytes(), 0u);
}

TEST(Memory, SmallestLimitOfAllGroupsAroundHolds) {
  FakeRoot root("0::/outer/middle/inner\n");
  root.group("outer/middle/inner", "memory.max", bytes(3000));
  root.group("outer/middle", "memory.max", "max\n");
  EXPECT_EQ(root.mebibytes(), 3000u);
  EXPECT_EQ(root.group("outer", "memory.max", bytes(2000)).mebibytes(), 2000u);
}

TEST(Memory, AContainerSeesItsGroupAtTheRoot) {
  FakeRoot root("0::/docker/0123abcd\n");
  EXPECT_EQ(root.group("", "memory.max", bytes(500)).mebibytes(), 500u);
}

TEST(Memory, Version1LeavesItsLimitMinusWhatIsUsed) {
  FakeRoot root("5:memory:/job/step\n4:cpu,cpuacct:/elsewhere\n");
  root.group("memory/job/step", "memory.limit_in_bytes", "9223372036854771712\n");
  EXPECT_EQ(root.mebibytes(), 8192u);
  root.group("memory/job", "memory.limit_in_bytes", bytes(4000));
  root.group("memory/job", "memory.usage_in_bytes", bytes(1000));
  root.group("memory/job", "memory.stat", "total_inactive_file " + bytes(200));
  EXPECT_EQ(root.mebibytes(), 3200u);
  EXPECT_TRUE(root.is_limited());
}

TEST(Memory, WhatDoesNotFitIsRefusedAndTheLimitIsNamed) {
  FakeRoot root("0::/job\n");
  root.group("job", "memory.max", bytes(1024));
  require_memory(1000 * kMebibyte, "the fit", "a larger --bin", root.path());
  const std::string said = message_of<Error>(
      [&] { require_memory(2048 * kMebibyte, "the fit", "a larger --bin", root.path()); });
  for (const char* part : {"the fit", "2.0 GiB", "1.0 GiB", "control group", "a larger --bin"})
    EXPECT_NE(said.find(part), std::string::npos) << said;
}

}  // namespace
}  // namespace tomofield::base
