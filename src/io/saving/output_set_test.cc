#include "io/saving/output_set.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <functional>
#include <string>
#include <thread>

#include "base/threads/parallel.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

namespace fs = std::filesystem;
using testing::message_of;
using testing::read_whole_file;
using testing::ScratchDirectory;

// Keeps a result of an earlier run in a folder of its own.
class OutputSetTest : public ::testing::Test {
 protected:
  ScratchDirectory scratch_;
  fs::path old_ = scratch_.write("old.txt", "old");
};

TEST_F(OutputSetTest, CanKeepOneFileAfterAnotherCouldNotGetItsName) {
  OutputSet results;
  write_text_file(old_, "new");
  write_text_file(scratch_ / "first.txt", "first");
  write_text_file(scratch_ / "second.txt", "second");
  fs::create_directory(scratch_ / "second.txt");
  EXPECT_THROW(results.commit(), Error);
  EXPECT_EQ(read_whole_file(old_), "old");
  EXPECT_FALSE(fs::exists(scratch_ / "first.txt"));
  EXPECT_TRUE(results.commit_only(scratch_ / "first.txt"));
  EXPECT_EQ(read_whole_file(scratch_ / "first.txt"), "first");
  EXPECT_EQ(read_whole_file(old_), "old");
}

TEST_F(OutputSetTest, GivesAllFilesTheirNamesTogether) {
  OutputSet results;
  write_text_file(old_, "new");
  write_text_file(scratch_ / "fresh.txt", "fresh");
  EXPECT_EQ(read_whole_file(old_), "old");
  EXPECT_FALSE(fs::exists(scratch_ / "fresh.txt"));
  EXPECT_EQ(read_whole_file(results.location_of(scratch_ / "fresh.txt")), "fresh");
  EXPECT_EQ(results.location_of(scratch_ / "none.txt"), scratch_ / "none.txt");
  results.commit();
  EXPECT_EQ(read_whole_file(old_), "new");
  EXPECT_EQ(read_whole_file(scratch_ / "fresh.txt"), "fresh");
  EXPECT_EQ(scratch_.num_files(), 2u);
}

TEST_F(OutputSetTest, LeavesNothingBehindWithoutCommit) {
  {
    OutputSet results;
    write_text_file(old_, "new");
    write_text_file(scratch_ / "fresh.txt", "fresh");
    results.remove_old(old_);
  }
  EXPECT_EQ(read_whole_file(old_), "old");
  EXPECT_EQ(scratch_.num_files(), 1u);
  write_text_file(scratch_ / "later.txt", "alone again");
  EXPECT_TRUE(fs::exists(scratch_ / "later.txt"));
}

TEST_F(OutputSetTest, GivesBackWhatItReplacedIfAFileCannotGetItsName) {
  const auto removed = scratch_.write("removed.txt", "removed");
  struct stat before {};
  ASSERT_EQ(::stat(old_.c_str(), &before), 0);
  {
    OutputSet results;
    write_text_file(old_, "new");
    write_text_file(scratch_ / "fresh.txt", "fresh");
    write_text_file(scratch_ / "blocked.txt", "blocked");
    results.remove_old(removed);
    fs::create_directory(scratch_ / "blocked.txt");
    const std::string message = message_of<Error>([&] { results.commit(); });
    EXPECT_NE(message.find("blocked.txt"), std::string::npos) << message;
  }
  EXPECT_EQ(read_whole_file(old_), "old");
  EXPECT_EQ(read_whole_file(removed), "removed");
  struct stat after {};
  ASSERT_EQ(::stat(old_.c_str(), &after), 0);
  EXPECT_EQ(before.st_ino, after.st_ino) << "it is the same file";
  EXPECT_EQ(scratch_.num_files(), 3u) << "the folder counts";
}

TEST_F(OutputSetTest, RemovesOldFilesWithItsCommit) {
  OutputSet results;
  results.remove_old(old_);
  results.remove_old(scratch_ / "absent.txt");
  write_text_file(scratch_ / "fresh.txt", "fresh");
  EXPECT_TRUE(fs::exists(old_));
  results.commit();
  EXPECT_FALSE(fs::exists(old_));
  EXPECT_EQ(scratch_.num_files(), 1u);
}

TEST_F(OutputSetTest, OfAnotherThreadHasFilesOfItsOwn) {
  OutputSet results;
  std::thread other([&] {
    OutputSet others;
    write_text_file(scratch_ / "other", "new");
    EXPECT_FALSE(fs::exists(scratch_ / "other"));
    others.commit();
    EXPECT_TRUE(fs::exists(scratch_ / "other"));
    EXPECT_EQ(OutputSet::active(), &others);
  });
  other.join();
  base::parallel_for("write", 8, [&](std::int64_t i) {
    EXPECT_EQ(OutputSet::active(), &results);
    write_text_file(scratch_ / ("part" + std::to_string(i)), "new");
  });
  EXPECT_FALSE(fs::exists(scratch_ / "part7"));
  results.commit();
  EXPECT_TRUE(fs::exists(scratch_ / "part7"));
}

TEST_F(OutputSetTest, KeepsOneFileOfMany) {
  OutputSet results;
  write_text_file(old_, "new");
  write_text_file(scratch_ / "kept.txt", "kept");
  EXPECT_FALSE(results.commit_only(scratch_ / "none.txt"));
  write_text_file(scratch_ / "kept.txt", "kept");
  EXPECT_TRUE(results.commit_only(scratch_ / "kept.txt"));
  EXPECT_EQ(read_whole_file(old_), "old");
  EXPECT_EQ(read_whole_file(scratch_ / "kept.txt"), "kept");
  EXPECT_EQ(scratch_.num_files(), 2u);
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
