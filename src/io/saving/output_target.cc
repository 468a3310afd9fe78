#include "io/saving/output_target.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <string>
#include <string_view>
#include <system_error>

#include "base/log.h"
#include "io/saving/file_identity.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace fs = std::filesystem;
namespace {

// Refuses to replace a file of another user in a sticky folder, as /tmp is. The system would, too,
// but only when all work is done.
void require_replaceable(const fs::path& target) {
  const uid_t user = ::geteuid();
  struct stat file {};
  struct stat folder {};
  if (user == 0 || ::lstat(target.c_str(), &file) != 0 ||
      ::stat(folder_of(target).c_str(), &folder) != 0)
    return;
  if ((folder.st_mode & S_ISVTX) == 0 || file.st_uid == user || folder.st_uid == user) return;
  throw Error(
      fmt::format("cannot replace '{}': it is a file of another user in a folder where each user "
                  "may remove only his own: give another name",
                  target.string()));
}

std::string temporary_prefix(const fs::path& target) {
  return fmt::format(".{}.tmp-", target.filename().string());
}

// Returns true for the end of a temporary file's name: PROCESS-NUMBER.
bool is_temporary_suffix(std::string_view suffix) {
  const auto dash = suffix.find('-');
  const auto is_number = [](std::string_view text) {
    return !text.empty() && std::all_of(text.begin(), text.end(),
                                        [](unsigned char c) { return std::isdigit(c) != 0; });
  };
  return dash != std::string_view::npos && is_number(suffix.substr(0, dash)) &&
         is_number(suffix.substr(dash + 1));
}

// Says whether the disk of a folder takes a new file of one block.
bool takes_a_block(const fs::path& folder) {
  const std::array<char, 4096> block{};
  const TemporaryFile probe = create_temporary(folder / "room");
  const bool is_written =
      ::write(probe.descriptor, block.data(), block.size()) == std::ssize(block) &&
      ::fsync(probe.descriptor) == 0;
  ::close(probe.descriptor);
  ::unlink(probe.path.c_str());
  return is_written;
}

}  // namespace

fs::path output_target(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    throw Error(
        fmt::format("cannot write '{}': it exists and is not a regular file", path.string()));
  }
  if (path.filename().empty()) {
    throw Error(fmt::format("cannot write '{}': a file name is missing", path.string()));
  }
  fs::path target = path;
  if (fs::is_symlink(path, error)) {
    target = fs::weakly_canonical(end_of_links(path), error);
    if (error) target = path;
  }
  require_replaceable(target);
  return target;
}

fs::file_status type_at(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::symlink_status(path, error);
  if (fs::status_known(status)) return status;
  throw Error(fmt::format("cannot write '{}': what is there now cannot be looked at: {}",
                          path.string(), error.message()));
}

fs::path folder_of(const fs::path& file) {
  return file.has_parent_path() ? file.parent_path() : fs::path(".");
}

fs::path unused_temporary_name(const fs::path& target) {
  static std::atomic<unsigned> counter{0};
  return folder_of(target) /
         fmt::format("{}{}-{}", temporary_prefix(target), ::getpid(), counter.fetch_add(1));
}

// Permissions come from the umask, which mkstemp would not honour.
TemporaryFile create_temporary(const fs::path& target) {
  while (true) {
    const fs::path candidate = unused_temporary_name(target);
    const int descriptor = ::open(candidate.c_str(), O_CREAT | O_EXCL | O_RDWR | O_CLOEXEC, 0666);
    if (descriptor >= 0) return {candidate, descriptor};
    if (errno == EEXIST) continue;  // a process of another machine or container has the same number
    throw Error(fmt::format("cannot write '{}': no file can be created in the directory '{}': {}",
                            target.string(), folder_of(target).string(), std::strerror(errno)));
  }
}

void remove_abandoned(const fs::path& target) {
  const std::string prefix = temporary_prefix(target);
  std::error_code error;
  for (fs::directory_iterator it(folder_of(target), error), end; !error && it != end;
       it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (name.starts_with(prefix) &&
        is_temporary_suffix(std::string_view(name).substr(prefix.size())))
      ::unlink(it->path().c_str());
  }
}

void require_room(const fs::path& folder, const fs::path& path, std::int64_t bytes) {
  constexpr double kGibibyte = 1 << 30;
  std::error_code error;
  const auto space = fs::space(folder, error);
  if (error || space.available >= static_cast<std::uintmax_t>(bytes)) return;
  if (space.available == 0 && takes_a_block(folder)) {
    return base::log_warning(
        fmt::format("'{}' needs {} bytes, but its disk has only 0 left", path.string(), bytes));
  }
  throw Error(fmt::format(
      "cannot write '{}': it needs {} bytes ({:.4g} GiB), and its disk has only {:.4g} GiB "
      "left: free some space there, write to another folder, or make a smaller volume",
      path.string(), bytes, static_cast<double>(bytes) / kGibibyte,
      static_cast<double>(space.available) / kGibibyte));
}

void require_writable(const fs::path& path) {
  const TemporaryFile probe = create_temporary(output_target(path));
  ::close(probe.descriptor);
  ::unlink(probe.path.c_str());
}

}  // namespace tomofield::io
