#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace tomofield::io {

/// Returns the file that writing `path` replaces. Follows a symbolic link, because replacing a link
/// would lose it. Throws Error if `path` names no file, if something is there that is no regular
/// file, or if this user may not replace the file that is there (one of another user in a sticky
/// folder).
std::filesystem::path output_target(const std::filesystem::path& path);

/// Returns what is at `path`, which may be a link itself. Throws Error if the system fails to say:
/// a file that cannot be looked at is not absent.
std::filesystem::file_status type_at(const std::filesystem::path& path);

/// Returns the folder of a file: "." for a mere name.
std::filesystem::path folder_of(const std::filesystem::path& file);

/// Creates an empty file beside `target` and opens it for reading and writing. Its name begins with
/// temporary_prefix(). Throws Error if the folder cannot be written.
struct TemporaryFile {
  std::filesystem::path path;
  int descriptor = -1;
};
TemporaryFile create_temporary(const std::filesystem::path& target);

/// Returns a name beside `target` for a temporary file that does not exist yet.
std::filesystem::path unused_temporary_name(const std::filesystem::path& target);

/// Removes all temporary files of `target`. The caller has the lock of `target` (OutputLock), so
/// that no other process uses them: they are from processes that were killed.
void remove_abandoned(const std::filesystem::path& target);

/// Throws Error if the disk of a folder has less room than the results called `path` need. Some
/// disks that have room say that they have none at all: a disk that takes a first block is written
/// with a warning.
void require_room(const std::filesystem::path& folder, const std::filesystem::path& path,
                  std::int64_t bytes);

/// Throws Error unless `path` can be written or replaced. Leaves nothing behind.
void require_writable(const std::filesystem::path& path);

}  // namespace tomofield::io
