#include "io/saving/output_lock.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <memory>
#include <optional>

#include "io/saving/atomic_file.h"
#include "io/saving/output_target.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

namespace fs = std::filesystem;
using testing::message_of;
using testing::ScratchDirectory;

// Another process that writes a file and never ends by itself.
class OtherWriter {
 public:
  explicit OtherWriter(const fs::path& path) {
    int ready[2];
    EXPECT_EQ(::pipe(ready), 0);
    process_ = ::fork();
    if (process_ == 0) {
      const AtomicFile file(path);
      (void)!::write(ready[1], "x", 1);
      while (true) ::pause();
    }
    char byte = 0;
    EXPECT_EQ(::read(ready[0], &byte, 1), 1);
    ::close(ready[0]);
    ::close(ready[1]);
  }
  ~OtherWriter() { kill(); }
  OtherWriter(const OtherWriter&) = delete;
  OtherWriter& operator=(const OtherWriter&) = delete;

  ::pid_t process() const { return process_; }
  void kill() {
    if (process_ == 0) return;
    ::kill(process_, SIGKILL);
    ::waitpid(process_, nullptr, 0);
    process_ = 0;
  }

 private:
  ::pid_t process_ = 0;
};

TEST(OutputLock, TellsWhoWritesTheFile) {
  const ScratchDirectory scratch;
  const OtherWriter other(scratch / "result.txt");
  char host[256] = {};
  ASSERT_EQ(::gethostname(host, sizeof host - 1), 0);
  const std::string message = message_of<Error>([&] { OutputLock(scratch / "result.txt"); });
  for (const std::string& fact :
       {(scratch / "result.txt").string(), std::string(host),
        fmt::format("process {}", other.process()), std::string("since 2")})
    EXPECT_NE(message.find(fact), std::string::npos) << message;
  EXPECT_EQ(message_of<Error>([&] { require_unlocked(scratch / "result.txt"); }), message);
  EXPECT_THROW(AtomicFile(scratch / "./result.txt"), Error);
  EXPECT_NO_THROW(OutputLock(scratch / "other.txt"));
}

TEST(OutputLock, ProtectsTheTemporaryFilesOfItsHolder) {
  const ScratchDirectory scratch;
  OtherWriter other(scratch / "result.txt");
  const auto num_files = scratch.num_files();
  EXPECT_EQ(num_files, 2u) << "the lock and the temporary file";
  require_writable(scratch / "result.txt");
  EXPECT_THROW(OutputLock(scratch / "result.txt"), Error);
  EXPECT_EQ(scratch.num_files(), num_files);
  other.kill();
  EXPECT_NO_THROW(require_unlocked(scratch / "result.txt"));
  EXPECT_EQ(scratch.num_files(), num_files);
  { const OutputLock lock(scratch / "result.txt"); }
  EXPECT_EQ(scratch.num_files(), 0u) << "what a killed process left is gone";
}

TEST(OutputLock, HoldsUntilTheLastUseInAProcessEnds) {
  const ScratchDirectory scratch;
  std::optional<OutputLock> lock(scratch / "result.txt");
  write_text_file(scratch / "result.txt", "text");
  EXPECT_EQ(scratch.num_files(), 2u);
  const OutputLock moved(std::move(*lock));
  lock.reset();
  EXPECT_EQ(scratch.num_files(), 2u);
}

TEST(OutputLock, IsTakenOverFromAKilledProcessOfAnotherUser) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can be two users";
  const ScratchDirectory scratch;
  fs::permissions(scratch.path(), fs::perms::all | fs::perms::sticky_bit);
  const auto stale = scratch.write(".result.txt.tomofield-lock", "process 1 on elsewhere");
  ASSERT_EQ(::chmod(stale.c_str(), 0644), 0);
  const ::pid_t other_user = ::fork();
  if (other_user == 0) {
    if (::setuid(12345) != 0) ::_exit(2);
    try {
      write_text_file(scratch / "result.txt", "text");
    } catch (const Error&) {
      ::_exit(1);
    }
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(other_user, &status, 0);
  EXPECT_EQ(status, 0);
}

TEST(OutputLock, FollowsNoLinkToAnotherFile) {
  const ScratchDirectory scratch;
  const auto other = scratch.write("other.txt", "years of work");
  fs::create_symlink(other, scratch / ".result.txt.tomofield-lock");
  EXPECT_THROW(OutputLock(scratch / "result.txt"), Error);
  EXPECT_EQ(testing::read_whole_file(other), "years of work");
}

}  // namespace
}  // namespace tomofield::io
