#include "io/atomic_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <string>
#include <system_error>
#include <utility>

#include "io/positioned_file.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace fs = std::filesystem;
namespace {

/// Returns the file to replace. It follows a symbolic link, because replacing a link would lose it.
fs::path resolve_target(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    throw Error(
        fmt::format("cannot write '{}': it exists and is not a regular file", path.string()));
  }
  if (path.filename().empty()) {
    throw Error(fmt::format("cannot write '{}': a file name is missing", path.string()));
  }
  if (!fs::is_symlink(path, error)) return path;
  const fs::path target = fs::weakly_canonical(path, error);
  return error ? path : target;
}

fs::path directory_of(const fs::path& file) {
  return file.has_parent_path() ? file.parent_path() : fs::path(".");
}

std::string temporary_prefix(const fs::path& target) {
  return fmt::format(".{}.tmp-", target.filename().string());
}

/// Removes temporary files of this target whose process was killed. Nothing else would remove them,
/// and a volume may have gigabytes.
void remove_abandoned(const fs::path& target) {
  const std::string prefix = temporary_prefix(target);
  std::error_code error;
  for (fs::directory_iterator it(directory_of(target), error), end; !error && it != end;
       it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (name.rfind(prefix, 0) != 0) continue;
    const char* const after_prefix = name.data() + prefix.size();
    ::pid_t process = 0;
    const auto [rest, fault] = std::from_chars(after_prefix, name.data() + name.size(), process);
    const bool is_ours = fault == std::errc() && process > 0 && *rest == '-';
    if (is_ours && ::kill(process, 0) != 0 && errno == ESRCH) ::unlink(it->path().c_str());
  }
}

/// Creates an empty file that no other process uses. Permissions come from the umask, which mkstemp
/// would not honour.
fs::path create_temporary(const fs::path& target) {
  static std::atomic<unsigned> counter{0};
  remove_abandoned(target);
  while (true) {
    const fs::path candidate =
        directory_of(target) /
        fmt::format("{}{}-{}", temporary_prefix(target), ::getpid(), counter.fetch_add(1));
    const int descriptor = ::open(candidate.c_str(), O_CREAT | O_EXCL | O_RDWR | O_CLOEXEC, 0666);
    if (descriptor >= 0) {
      ::close(descriptor);
      return candidate;
    }
    if (errno == EEXIST) {
      ::unlink(candidate.c_str());  // left by a killed process that had the same process id
    } else {
      throw Error(fmt::format("cannot write '{}': no file can be created in the directory '{}': {}",
                              target.string(), directory_of(target).string(),
                              std::strerror(errno)));
    }
  }
}

void flush_to_disk(const fs::path& path, int open_flags) {
  const int descriptor = ::open(path.c_str(), open_flags | O_CLOEXEC);
  const bool flushed = descriptor >= 0 && ::fsync(descriptor) == 0;
  // Some file systems cannot flush a directory; then the rename alone must suffice.
  const bool unsupported = descriptor >= 0 && !flushed && (errno == EINVAL || errno == ENOTSUP);
  const int error = errno;
  if (descriptor >= 0) ::close(descriptor);
  if (!flushed && !unsupported) {
    throw Error(
        fmt::format("cannot write '{}' to the disk: {}", path.string(), std::strerror(error)));
  }
}

}  // namespace

AtomicFile::AtomicFile(const fs::path& path)
    : path_(path), target_(resolve_target(path)), temporary_path_(create_temporary(target_)) {}

AtomicFile::~AtomicFile() {
  if (!temporary_path_.empty()) ::unlink(temporary_path_.c_str());
}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : path_(std::move(other.path_)),
      target_(std::move(other.target_)),
      temporary_path_(std::exchange(other.temporary_path_, {})) {}

void AtomicFile::commit() {
  flush_to_disk(temporary_path_, O_RDWR);
  std::error_code error;
  fs::rename(temporary_path_, target_, error);
  if (error) {
    throw Error(fmt::format("cannot replace '{}': {}", path_.string(), error.message()));
  }
  temporary_path_.clear();
  flush_to_disk(directory_of(target_), O_RDONLY | O_DIRECTORY);
}

void write_text_file(const fs::path& path, std::string_view text) {
  AtomicFile file(path);
  PositionedFile contents(file.temporary_path(), PositionedFile::Access::kReadWrite);
  contents.write_at(0, text.data(), text.size());
  contents.close();
  file.commit();
}

}  // namespace tomofield::io
