#include "io/saving/atomic_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "io/saving/output_set.h"
#include "io/saving/output_target.h"
#include "io/saving/positioned_file.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace fs = std::filesystem;
namespace {

constexpr mode_t kPermissions = 07777;

std::optional<struct stat> status_of(const fs::path& file) {
  struct stat status {};
  return ::stat(file.c_str(), &status) == 0 ? std::optional(status) : std::nullopt;
}

// Gives a file the owner and the permissions of another, as far as that is allowed.
void take_after(const struct stat& other, mode_t more_permissions, int descriptor) {
  if (::fchown(descriptor, other.st_uid, other.st_gid) != 0)
    (void)!::fchown(descriptor, static_cast<uid_t>(-1), other.st_gid);
  (void)!::fchmod(descriptor, (other.st_mode & kPermissions) | more_permissions);
}

}  // namespace

AtomicFile::AtomicFile(const fs::path& path)
    : path_(path), target_(output_target(path)), lock_(target_), replaced_(status_of(target_)) {
  TemporaryFile temporary = create_temporary(target_);
  temporary_path_ = std::move(temporary.path);
  descriptor_ = temporary.descriptor;
  // Others must not read meanwhile what they may not read later; this process must write it.
  if (replaced_) take_after(*replaced_, S_IRUSR | S_IWUSR, descriptor_);
}

AtomicFile::~AtomicFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
  if (!temporary_path_.empty()) ::unlink(temporary_path_.c_str());
}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : path_(std::move(other.path_)),
      target_(std::move(other.target_)),
      lock_(std::move(other.lock_)),
      replaced_(other.replaced_),
      descriptor_(std::exchange(other.descriptor_, -1)),
      temporary_path_(std::exchange(other.temporary_path_, {})) {}

void AtomicFile::flush() {
  if (replaced_) take_after(*replaced_, 0, descriptor_);
  const bool is_flushed = ::fsync(descriptor_) == 0 || errno == EINVAL || errno == ENOTSUP;
  const int flush_error = errno;
  // Some file systems say only when a file is closed that it has no room.
  const bool is_closed = ::close(std::exchange(descriptor_, -1)) == 0;
  if (is_flushed && is_closed) return;
  throw Error(fmt::format("cannot write '{}' to the disk: {}", path_.string(),
                          std::strerror(is_flushed ? errno : flush_error)));
}

void AtomicFile::commit() {
  flush();
  if (OutputSet* const collecting = OutputSet::active()) return collecting->add(std::move(*this));
  OutputSet alone(OutputSet::kOneFile);
  alone.add(std::move(*this));
  alone.commit();
}

void write_text_file(const fs::path& path, std::string_view text) {
  AtomicFile file(path);
  PositionedFile contents(file.temporary_path(), PositionedFile::Access::kReadWrite);
  contents.write_at(0, text.data(), text.size());
  contents.close();
  file.commit();
}

}  // namespace tomofield::io
