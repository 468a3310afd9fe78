#include "io/saving/atomic_file.h"

#include <fmt/core.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "io/json.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

using testing::message_of;
using testing::read_whole_file;
using testing::ScratchDirectory;

TEST(AtomicFile, ReplacesOnCommitOnly) {
  const ScratchDirectory scratch;
  const auto path = scratch.write("result.txt", "old");
  AtomicFile file(path);
  std::ofstream(file.temporary_path()) << "new";
  EXPECT_EQ(read_whole_file(path), "old");
  file.commit();
  EXPECT_EQ(read_whole_file(path), "new");
  EXPECT_EQ(scratch.num_files(), 1u);
}

TEST(AtomicFile, LeavesNothingBehindWithoutCommit) {
  const ScratchDirectory scratch;
  const auto path = scratch.write("result.txt", "old");
  {
    AtomicFile file(path);
    std::ofstream(file.temporary_path()) << "half of the n";
    AtomicFile moved(std::move(file));
    EXPECT_EQ(scratch.num_files(), 3u) << "the old file, the new one, and the lock";
  }
  EXPECT_EQ(read_whole_file(path), "old");
  EXPECT_EQ(scratch.num_files(), 1u);
}

TEST(AtomicFile, HonoursTheUmask) {
  const ScratchDirectory scratch;
  const mode_t before = ::umask(027);
  write_text_file(scratch / "result.txt", "text");
  ::umask(before);
  struct stat status {};
  ASSERT_EQ(::stat((scratch / "result.txt").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777u, 0640u);
}

TEST(AtomicFile, WritesThroughSymbolicLinks) {
  const ScratchDirectory scratch;
  const auto target = scratch.write("target.txt", "old");
  std::filesystem::create_symlink("target.txt", scratch / "link.txt");
  write_text_file(scratch / "link.txt", "new");
  EXPECT_TRUE(std::filesystem::is_symlink(scratch / "link.txt"));
  EXPECT_EQ(read_whole_file(target), "new");
}

TEST(AtomicFile, RemovesWhatKilledProcessesLeft) {
  const ScratchDirectory scratch;
  const auto left_by = [&](const char* target, ::pid_t process, const char* number) {
    const auto path = scratch / fmt::format(".{}.tmp-{}-{}", target, process, number);
    std::ofstream(path) << "half a result";
    return path;
  };
  // Processes of other containers and machines may have any number.
  const auto abandoned = left_by("result.txt", 99999999, "3");
  const auto of_a_number_in_use = left_by("result.txt", ::getppid(), "0");
  const auto of_another_target = left_by("other.txt", 99999999, "0");
  const auto not_ours = left_by("result.txt", 99999999, "backup");
  write_text_file(scratch / "result.txt", "whole");
  EXPECT_FALSE(std::filesystem::exists(abandoned));
  EXPECT_FALSE(std::filesystem::exists(of_a_number_in_use));
  EXPECT_TRUE(std::filesystem::exists(of_another_target));
  EXPECT_TRUE(std::filesystem::exists(not_ours));
}

mode_t mode_of(const std::filesystem::path& path) {
  struct stat status {};
  EXPECT_EQ(::stat(path.c_str(), &status), 0);
  return status.st_mode & 07777u;
}

TEST(AtomicFile, KeepsThePermissionsOfTheFileThatItReplaces) {
  const ScratchDirectory scratch;
  for (const mode_t mode : {0600u, 0444u, 0664u, 0755u}) {
    const auto path = scratch.write("result.txt", "old");
    ASSERT_EQ(::chmod(path.c_str(), mode), 0);
    AtomicFile file(path);
    EXPECT_EQ(mode_of(file.temporary_path()), mode | 0600u) << "nobody else may read it meanwhile";
    std::ofstream(file.temporary_path()) << "new";
    file.commit();
    EXPECT_EQ(mode_of(path), mode);
    EXPECT_EQ(read_whole_file(path), "new");
    std::filesystem::remove(path);
  }
}

TEST(AtomicFile, KeepsTheOwnerWhereThatIsAllowed) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root may give files away";
  const ScratchDirectory scratch;
  const auto path = scratch.write("result.txt", "old");
  ASSERT_EQ(::chown(path.c_str(), 1234, 2345), 0);
  write_text_file(path, "new");
  struct stat status {};
  ASSERT_EQ(::stat(path.c_str(), &status), 0);
  EXPECT_EQ(status.st_uid, 1234u);
  EXPECT_EQ(status.st_gid, 2345u);
}

TEST(AtomicFile, RefusesWhatCannotBeWrittenAtOnce) {
  const ScratchDirectory scratch;
  EXPECT_THROW(AtomicFile(scratch / "absent/result.txt"), Error);
  EXPECT_THROW(AtomicFile(scratch.path()), Error);
  EXPECT_THROW(AtomicFile("/dev/null"), Error);
  const std::string message = message_of<Error>([&] { AtomicFile(scratch / "absent/result.txt"); });
  EXPECT_NE(message.find("absent"), std::string::npos) << message;
  EXPECT_EQ(scratch.num_files(), 0u);
}

TEST(AtomicFile, RefusesAReadOnlyDirectory) {
  if (::geteuid() == 0) GTEST_SKIP() << "root may write everywhere";
  const ScratchDirectory scratch;
  const auto closed = scratch / "closed";
  std::filesystem::create_directory(closed);
  std::filesystem::permissions(
      closed, std::filesystem::perms::owner_read | std::filesystem::perms::owner_exec);
  EXPECT_THROW(AtomicFile(closed / "result.txt"), Error);
}

TEST(Json, IsWrittenForPeople) {
  const ScratchDirectory scratch;
  write_json(scratch / "metrics.json",
             {{"name", "a\xff"}, {"loss", 0.5}});  // invalid UTF-8 survives
  const auto read = nlohmann::json::parse(read_whole_file(scratch / "metrics.json"));
  EXPECT_EQ(read["loss"], 0.5);
}

}  // namespace
}  // namespace tomofield::io
