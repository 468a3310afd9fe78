#pragma once

#include <filesystem>
#include <functional>
#include <vector>

namespace tomofield::io {

/// Keeps other processes from writing a file, for as long as the object lives. A process may lock
/// the same file several times; the last object that goes unlocks it.
///
/// The lock is an flock() on the file .NAME.tomofield-lock beside NAME, which says who holds it.
/// The system gives the lock up when the process ends in any way, so a killed process blocks
/// nobody. It holds for other machines and containers where the file system carries flock() there,
/// as NFS, Lustre with -o flock, BeeGFS and GPFS do. A file system without flock() gives no lock:
/// then a warning says so, the run goes on, and temporary files of other processes are never
/// removed.
///
/// Temporary files of NAME belong to the process that has the lock. What a killed process left is
/// removed when the lock is taken.
class OutputLock {
 public:
  /// Locks `path`. Throws Error, with what is known of the holder, if another process has the lock;
  /// or if the folder cannot be written.
  explicit OutputLock(const std::filesystem::path& path);
  ~OutputLock();
  OutputLock(OutputLock&& other) noexcept;
  OutputLock& operator=(OutputLock&&) = delete;

 private:
  std::filesystem::path key_;  // empty once moved from
};

/// Says whether there is a lock file of `path`: a process writes it, or was killed while it did.
bool has_lock_file(const std::filesystem::path& path);

/// Throws Error, as OutputLock does, if another process has the lock of `path`. Locks nothing and
/// makes no file.
void require_unlocked(const std::filesystem::path& path);

/// Locks the results of a run after `check`, which throws Error if they must not be written. Calls
/// `check` once more behind the locks, because another run may have made the files meanwhile.
std::vector<OutputLock> claim_outputs(const std::vector<std::filesystem::path>& paths,
                                      const std::function<void()>& check);

}  // namespace tomofield::io
