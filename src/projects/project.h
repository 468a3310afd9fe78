#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "option_table/setting.h"

namespace tomofield::projects {

/// A file or folder of another program, and the wishes of the user for reading it.
struct Request {
  std::filesystem::path path = {};
  std::vector<std::string> ignored = {};  ///< names of entries that are not applied (--ignore)
  std::string series = {};                ///< of a project that has several (--series); empty: all
  bool has_mdoc = false;      ///< the user gave --mdoc, so a folder may be that of its images
  bool has_transfer = false;  ///< the user gave a contrast transfer, which optics describe
  std::string exclude = {};   ///< sections that the user leaves out, as --exclude has them
  bool has_detector = false;  ///< the user gave the detector's transfer, or --ctf none
  std::optional<double> pixel_size_A = {};  ///< that the user gave, if any
};

/// The files of another program as settings of this one, each with its origin.
class Project {
 public:
  explicit Project(const Request& request) : request_(request) {}

  const Request& request() const { return request_; }
  const std::vector<Setting>& settings() const { return settings_; }
  const std::vector<std::string>& warnings() const { return warnings_; }
  const std::vector<std::filesystem::path>& files() const { return files_; }

  /// Notes a file that was read. Results must not replace it.
  void add_file(const std::filesystem::path& file) { files_.push_back(file); }

  /// Returns true if the user wants an entry of a file not to be applied, by its name in upper or
  /// lower case. A format asks for every entry that it knows, once it has found it in the file: an
  /// --ignore that nothing has asked for is refused.
  bool ignores(std::string_view entry);

  /// Sets an option, unless the user wants its entry not to be applied. A flag is set by "true".
  /// An option is set once. `row` names the row of a file that lists several series.
  void set(std::string_view option, std::string value, const std::filesystem::path& file,
           std::string_view entry, std::string row = {});

  /// Returns the value of an option that is set, or an empty text.
  std::string value_of(std::string_view option) const;

  /// Adds a warning about something that the result does not show by itself.
  void warn(std::string message) { warnings_.push_back(std::move(message)); }

  /// Throws Error if the user named an entry to ignore that no file has.
  void require_no_stray_ignored() const;

 private:
  Request request_;
  std::vector<Setting> settings_;
  std::vector<std::string> warnings_;
  std::vector<std::filesystem::path> files_;
  std::vector<std::string> met_;  ///< entries that ignores() was asked for
};

/// A kind of project. A new one is a function that reads it, and a line in formats.cc.
struct Format {
  std::string_view name;       ///< for messages: "AreTomo's alignment"
  std::string_view extension;  ///< of its main file, in lower case: ".aln"
  /// Returns true if a file of a folder is, by its name, the main file of a project.
  bool (*is_main_file)(std::string_view name);
  /// A word that a main file has within its text; empty: its name is enough.
  std::string_view word = {};
  /// Reads the main file `project.request().path` and what lies beside it, and sets options. Throws
  /// Error if they cannot be honoured.
  void (*read)(Project& project);
  /// A folder is read by the main files of the lowest rank that it has: files that say how a series
  /// is aligned come before those that only accompany it.
  int rank = 0;
  bool has_several = false;  ///< a project may have several series, of which --series names one
};

/// Throws Error if the user chose a series (--series) of what is one series.
void require_no_series(const Request& request);

/// Returns all kinds of projects.
std::span<const Format> all_formats();

/// Reads the project at `request.path`, which may be its folder. Returns nothing if the path is
/// that of a stack, or of no file at all, or of a folder of images. Throws Error for another folder
/// without a project, for one with several, and for a project that cannot be honoured.
std::optional<Project> read_project(const Request& request);

}  // namespace tomofield::projects
