#include "io/saving/output_lock.h"

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include "base/log.h"
#include "io/saving/output_target.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace fs = std::filesystem;
namespace {

constexpr std::size_t kMaxHolderBytes = 400;

// A lock of this process.
struct Held {
  fs::path file;
  int descriptor = -1;  // -1: the file system has no locks
  int uses = 0;
};

std::mutex g_mutex;  // guards g_held
std::map<fs::path, Held> g_held;

// Returns what the lock tells others: "process 4711 on node7 since 2026-11-23 15:20:11 UTC".
std::string own_name() {
  std::array<char, 256> host{};
  if (::gethostname(host.data(), host.size() - 1) != 0) host = {"an unknown machine"};
  return fmt::format("process {} on {} since {:%Y-%m-%d %H:%M:%S} UTC", ::getpid(), host.data(),
                     fmt::gmtime(std::time(nullptr)));
}

// Returns what the holder of a lock wrote there, or an empty text. It may be another program's.
std::string holder_of(int descriptor) {
  std::array<char, kMaxHolderBytes> bytes{};
  const ssize_t count = ::pread(descriptor, bytes.data(), bytes.size(), 0);
  std::string text(bytes.data(), count > 0 ? static_cast<std::size_t>(count) : 0);
  std::erase_if(text, [](unsigned char c) { return c < 0x20 || c > 0x7e; });
  return text;
}

// Returns the descriptor of the lock file, or -1 with errno. What another user's killed process
// left may be open to reading alone, or refuse O_CREAT (sysctl fs.protected_regular).
int open_lock_file(const fs::path& file) {
  constexpr int kAlways = O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK;
  const int made = ::open(file.c_str(), O_RDWR | O_CREAT | kAlways, 0666);
  if (made >= 0 || errno != EACCES) return made;
  for (const int access : {O_RDWR, O_RDONLY}) {
    const int there = ::open(file.c_str(), access | kAlways);
    if (there >= 0) return there;
  }
  errno = EACCES;
  return -1;
}

// Says whether a name still leads to an open file. Its last holder may just have removed it.
bool is_still_there(const fs::path& file, int descriptor) {
  struct stat by_name {};
  struct stat opened {};
  return ::lstat(file.c_str(), &by_name) == 0 && ::fstat(descriptor, &opened) == 0 &&
         by_name.st_ino == opened.st_ino && by_name.st_dev == opened.st_dev;
}

fs::path lock_file_of(const fs::path& target) {
  return folder_of(target) / fmt::format(".{}.tomofield-lock", target.filename().string());
}

// Returns the one path of a target, by which this process knows its locks.
fs::path key_of(const fs::path& target) {
  std::error_code error;
  const fs::path folder = fs::weakly_canonical(folder_of(target), error);
  if (!error) return folder / target.filename();
  throw Error(fmt::format("cannot write '{}': its directory '{}' cannot be found: {}",
                          target.string(), folder_of(target).string(), error.message()));
}

[[noreturn]] void throw_lost(const fs::path& target, const fs::path& lock) {
  throw Error(fmt::format(
      "cannot write '{}': its lock '{}' cannot be found again after it is made; look at "
      "the file system of this folder, or write to another one",
      target.string(), lock.string()));
}

[[noreturn]] void throw_held(const fs::path& target, const std::string& holder) {
  throw Error(
      fmt::format("another run writes '{}' now ({}): wait until it has ended, or give another name",
                  target.string(), holder.empty() ? "who it is, is not known" : holder));
}

void warn_of_no_locks(const fs::path& folder) {
  static std::once_flag once;
  std::call_once(once, [&] {
    base::log_warning(
        fmt::format("the file system of '{}' has no locks: see to it that no other run writes the "
                    "same files",
                    folder.string()));
  });
}

// Tries once to take the lock. Returns false if the lock file was removed meanwhile.
bool try_lock(const fs::path& target, Held& held) {
  held.descriptor = open_lock_file(held.file);
  if (held.descriptor < 0) {
    throw Error(fmt::format("cannot write '{}': no file can be created in the directory '{}': {}",
                            target.string(), folder_of(target).string(), std::strerror(errno)));
  }
  int result = 0;
  do result = ::flock(held.descriptor, LOCK_EX | LOCK_NB);
  while (result != 0 && errno == EINTR);
  if (result == 0 && is_still_there(held.file, held.descriptor)) return true;
  const int error = errno;
  const std::string holder = holder_of(held.descriptor);
  ::close(std::exchange(held.descriptor, -1));
  if (result == 0) return false;
  if (error == EWOULDBLOCK) throw_held(target, holder);
  ::unlink(held.file.c_str());
  warn_of_no_locks(folder_of(target));
  return true;
}

// Writes who holds the lock, for everybody to read and, once it is stale, to take over.
void sign(const Held& held) {
  const std::string name = own_name();
  (void)!::ftruncate(held.descriptor, 0);
  (void)!::pwrite(held.descriptor, name.data(), name.size(), 0);
  (void)!::fchmod(held.descriptor, 0666);
}

void take(const fs::path& target, Held& held) {
  constexpr int kMostTries = 100;  // other processes make and remove their locks meanwhile
  for (int tries = 1; !try_lock(target, held); ++tries)
    if (tries == kMostTries) throw_lost(target, held.file);
  if (held.descriptor < 0) return;
  sign(held);
  remove_abandoned(target);
}

}  // namespace

OutputLock::OutputLock(const fs::path& path) {
  const fs::path target = output_target(path);
  fs::path key = key_of(target);
  const std::lock_guard guard(g_mutex);
  Held& held = g_held[key];
  if (held.uses == 0) {
    held.file = lock_file_of(key);
    try {
      take(target, held);
    } catch (...) {
      g_held.erase(key);
      throw;
    }
  }
  ++held.uses;
  key_ = std::move(key);
}

OutputLock::~OutputLock() {
  if (key_.empty()) return;
  const std::lock_guard guard(g_mutex);
  const auto found = g_held.find(key_);
  if (--found->second.uses > 0) return;
  if (found->second.descriptor >= 0) {
    ::unlink(found->second.file.c_str());  // before others can take the lock
    ::close(found->second.descriptor);
  }
  g_held.erase(found);
}

OutputLock::OutputLock(OutputLock&& other) noexcept : key_(std::exchange(other.key_, {})) {}

bool has_lock_file(const fs::path& path) {
  std::error_code failed;
  return fs::exists(lock_file_of(output_target(path)), failed);
}

void require_unlocked(const fs::path& path) {
  const fs::path target = output_target(path);
  const int descriptor =
      ::open(lock_file_of(target).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (descriptor < 0) return;
  const bool is_held = ::flock(descriptor, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  const std::string holder = holder_of(descriptor);
  ::close(descriptor);
  if (is_held) throw_held(target, holder);
}

std::vector<OutputLock> claim_outputs(const std::vector<fs::path>& paths,
                                      const std::function<void()>& check) {
  check();
  std::vector<OutputLock> locks;
  for (const fs::path& path : paths) locks.emplace_back(path);
  check();
  return locks;
}

}  // namespace tomofield::io
