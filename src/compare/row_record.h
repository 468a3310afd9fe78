#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "base/system/child_process.h"

// The state of a run of a comparison (NAME.row.json), by which an interrupted one continues.
namespace tomofield::compare {

/// The progress of a run. A run that is marked as running when nobody runs it was killed; its costs
/// since its last start are not known.
enum class Progress { kNone, kRunning, kStopped, kFinished };

struct RowState {
  Progress progress = Progress::kNone;
  base::Costs costs;  ///< of all sessions
};

/// What decides a run's results.
struct RunOrigin {
  /// Size and time tell whether a file has changed without reading it.
  struct FileState {
    std::uintmax_t bytes = 0;
    std::int64_t written = 0;  ///< ticks of the file system's clock
    bool operator==(const FileState&) const = default;
  };

  std::string version;  ///< of tomofield
  std::vector<std::string> command;
  std::map<std::string, FileState> files;  ///< that the run reads, by their absolute paths

  /// Returns the differences to the origin that a run would have `now`, a clause each.
  std::vector<std::string> differences_to(const RunOrigin& now) const;
};

/// Returns words as UTF-8, which JSON needs (base/utf8.h).
std::vector<std::string> utf8_texts(const std::vector<std::string>& words);

/// Returns the origin of a run by this version. Throws an exception of std::filesystem for an input
/// that does not exist.
RunOrigin origin_of(const std::vector<std::string>& command,
                    const std::vector<std::filesystem::path>& inputs);

/// Returns the sentence that refuses a file of a comparison, with the reason and what to do.
std::string not_of_this_comparison(const std::filesystem::path& file, const std::string& why);

/// Reads the state of a run from `file`; returns kNone if there is no such file. Throws Error, with
/// every difference, if the run has another origin, and for a file that write_row() did not write.
RowState read_row(const std::filesystem::path& file, const RunOrigin& origin);
void write_row(const std::filesystem::path& file, const RunOrigin& origin, const RowState& state);

/// Returns a command of the program as a person can give it to a shell: "tomofield baseline wbp …".
std::string shell_command(const std::vector<std::string>& words);

}  // namespace tomofield::compare
