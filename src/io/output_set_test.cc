#include "io/output_set.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <functional>

#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

namespace fs = std::filesystem;
using testing::message_of;
using testing::read_whole_file;
using testing::ScratchDirectory;

TEST(OutputSet, GivesAllFilesTheirNamesTogether) {
  const ScratchDirectory scratch;
  const auto old = scratch.write("old.txt", "old");
  OutputSet results;
  write_text_file(old, "new");
  write_text_file(scratch / "fresh.txt", "fresh");
  EXPECT_EQ(read_whole_file(old), "old");
  EXPECT_FALSE(fs::exists(scratch / "fresh.txt"));
  EXPECT_EQ(read_whole_file(results.location_of(scratch / "fresh.txt")), "fresh");
  EXPECT_EQ(results.location_of(scratch / "none.txt"), scratch / "none.txt");
  results.commit();
  EXPECT_EQ(read_whole_file(old), "new");
  EXPECT_EQ(read_whole_file(scratch / "fresh.txt"), "fresh");
  EXPECT_EQ(scratch.num_files(), 2u);
}

TEST(OutputSet, LeavesNothingBehindWithoutCommit) {
  const ScratchDirectory scratch;
  const auto old = scratch.write("old.txt", "old");
  {
    OutputSet results;
    write_text_file(old, "new");
    write_text_file(scratch / "fresh.txt", "fresh");
    results.remove_old(old);
  }
  EXPECT_EQ(read_whole_file(old), "old");
  EXPECT_EQ(scratch.num_files(), 1u);
  write_text_file(scratch / "later.txt", "alone again");
  EXPECT_TRUE(fs::exists(scratch / "later.txt"));
}

TEST(OutputSet, GivesBackWhatItReplacedIfAFileCannotGetItsName) {
  const ScratchDirectory scratch;
  const auto old = scratch.write("old.txt", "old");
  const auto removed = scratch.write("removed.txt", "removed");
  struct stat before {};
  ASSERT_EQ(::stat(old.c_str(), &before), 0);
  {
    OutputSet results;
    write_text_file(old, "new");
    write_text_file(scratch / "fresh.txt", "fresh");
    write_text_file(scratch / "blocked.txt", "blocked");
    results.remove_old(removed);
    fs::create_directory(scratch / "blocked.txt");
    const std::string message = message_of<Error>([&] { results.commit(); });
    EXPECT_NE(message.find("blocked.txt"), std::string::npos) << message;
  }
  EXPECT_EQ(read_whole_file(old), "old");
  EXPECT_EQ(read_whole_file(removed), "removed");
  struct stat after {};
  ASSERT_EQ(::stat(old.c_str(), &after), 0);
  EXPECT_EQ(before.st_ino, after.st_ino) << "it is the same file";
  EXPECT_EQ(scratch.num_files(), 3u) << "the folder counts";
}

TEST(OutputSet, RemovesOldFilesWithItsCommit) {
  const ScratchDirectory scratch;
  const auto stale = scratch.write("stale.txt", "of an earlier run");
  OutputSet results;
  results.remove_old(stale);
  results.remove_old(scratch / "absent.txt");
  write_text_file(scratch / "fresh.txt", "fresh");
  EXPECT_TRUE(fs::exists(stale));
  results.commit();
  EXPECT_FALSE(fs::exists(stale));
  EXPECT_EQ(scratch.num_files(), 1u);
}

TEST(OutputSet, KeepsOneFileOfMany) {
  const ScratchDirectory scratch;
  const auto old = scratch.write("old.txt", "old");
  OutputSet results;
  write_text_file(old, "new");
  write_text_file(scratch / "kept.txt", "kept");
  EXPECT_FALSE(results.commit_only(scratch / "none.txt"));
  write_text_file(scratch / "kept.txt", "kept");
  EXPECT_TRUE(results.commit_only(scratch / "kept.txt"));
  EXPECT_EQ(read_whole_file(old), "old");
  EXPECT_EQ(read_whole_file(scratch / "kept.txt"), "kept");
  EXPECT_EQ(scratch.num_files(), 2u);
}

// Calls `body` as another user than root, in a process of its own. Returns its exit status.
int status_as_other_user(const std::function<void()>& body) {
  const ::pid_t process = ::fork();
  if (process == 0) {
    if (::setuid(12345) != 0) ::_exit(3);
    try {
      body();
    } catch (const Error&) {
      ::_exit(2);
    }
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(process, &status, 0);
  return WEXITSTATUS(status);
}

TEST(OutputSet, RefusesFilesOfOthersInAStickyFolderAtOnce) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can be two users";
  const ScratchDirectory scratch;
  const auto theirs = scratch.write("result.txt", "theirs");
  fs::permissions(scratch.path(), fs::perms::all | fs::perms::sticky_bit);
  EXPECT_EQ(status_as_other_user([&] { AtomicFile{theirs}; }), 2);
  EXPECT_EQ(status_as_other_user([&] { write_text_file(scratch / "own.txt", "own"); }), 0);
  EXPECT_EQ(status_as_other_user([&] { write_text_file(scratch / "own.txt", "again"); }), 0);
  EXPECT_EQ(read_whole_file(theirs), "theirs");
}

}  // namespace
}  // namespace tomofield::io
