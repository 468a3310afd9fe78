#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/tables/command_file.h"
#include "projects/project.h"

namespace tomofield::projects {

/// Returns the command file of another program of the same axis, which may not be there:
/// ctfplottera.com beside tilta.com.
std::filesystem::path command_file_beside(const std::filesystem::path& tilt_com,
                                          std::string_view program);

/// The entries of one command of a command file, as a project asks for them. Names do not depend on
/// upper and lower case. An entry that the user ignores is as if it were not there. Each function
/// notes its entry as known; warn_about_others() tells of those that nobody asked for.
class CommandEntries {
 public:
  /// Finds the command `program` in the file. Throws Error if the file has none, or several, or if
  /// it does not read its entries from the lines below it.
  CommandEntries(Project& project, const std::filesystem::path& file, std::string_view program);

  const std::filesystem::path& file() const { return file_; }

  bool has(std::string_view name) { return find(name) != nullptr; }
  /// Returns the text of an entry. Throws Error if it comes twice or is empty.
  std::optional<std::string> text(std::string_view name);
  /// Returns the file that an entry names (io/named_file.h): where the entry says, from the folder
  /// of the command file, or else beside the command file or above it, where it lies if the folder
  /// was moved. Where there is none, returns the first of these places.
  std::optional<std::filesystem::path> path(std::string_view name);
  /// Returns the numbers of an entry, which has from `fewest` to `most` of them, finite and
  /// plausible. As in IMOD, nothing between two commas stands for a default value, and so does a
  /// slash for those that follow: these are taken from `defaults`. Returns nothing for an entry of
  /// defaults alone, or without a value. Throws Error otherwise.
  std::optional<std::vector<double>> numbers(std::string_view name, std::size_t fewest,
                                             std::size_t most,
                                             std::span<const double> defaults = {});
  /// Returns a width and a height, which must be above 0; nothing as numbers() does.
  std::optional<std::vector<double>> sizes(std::string_view name);
  std::optional<double> number(std::string_view name);
  /// Returns the texts of an entry that may come several times.
  std::vector<std::string> texts(std::string_view name);

  /// Returns what is wrong with an entry that cannot be honoured, or nothing without such an entry:
  /// "line 8: LOCALFILE aligns parts of the views".
  std::optional<std::string> fault_of(std::string_view name, std::string_view why);
  /// Notes entries that make no difference to this program's result.
  void know(std::span<const std::string_view> names);
  /// Warns of each entry that nobody has asked for, by its name.
  void warn_about_others();

 private:
  const io::CommandEntry* find(std::string_view name);
  [[noreturn]] void fail(const io::CommandEntry& entry, std::string_view expected) const;

  Project& project_;
  std::filesystem::path file_;
  io::Command command_;
  std::set<std::string> known_;  ///< names in upper case
};

}  // namespace tomofield::projects
