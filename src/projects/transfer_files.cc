#include "projects/transfer_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "io/is_file.h"
#include "io/tables/command_file.h"
#include "io/tables/mtf_table.h"
#include "io/tables/text_lines.h"
#include "projects/command_entries.h"
#include "projects/stacks.h"
#include "tomofield/error.h"

namespace tomofield::projects {

namespace fs = std::filesystem;
namespace {

constexpr const char* kEntryOfCtf = "CTF";
constexpr const char* kEntryOfMtf = "MTF";

std::string lower_case(std::string text) {
  std::ranges::transform(text, text.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

bool is_mtf(const fs::path& path) {
  const std::string name = lower_case(path.filename().string());
  if (!name.ends_with(".star") || name.find("mtf") == std::string::npos) return false;
  try {
    io::read_mtf(path);
    return true;
  } catch (const Error&) {
    return false;
  }
}

void set_mtf(Project& project, const fs::path& folder) {
  std::vector<fs::path> found;
  std::error_code failed;
  // A relative file that is named alone has no folder.
  const fs::path where = folder.empty() ? fs::path(".") : folder;
  for (const fs::directory_entry& entry : fs::directory_iterator(where, failed))
    if (is_mtf(entry.path())) found.push_back(folder / entry.path().filename());
  if (found.size() == 1) project.set("--mtf", found.front().string(), found.front(), kEntryOfMtf);
}

// Sets a file with the contrast transfer of the views, and the transfer of the camera beside it.
// Returns false if the user ignores it.
bool set_transfer_file(Project& project, const fs::path& file, const fs::path& named_in) {
  const bool is_ignored = project.ignores(kEntryOfCtf);
  if (!is_ignored) project.set("--ctf", file.string(), named_in, kEntryOfCtf);
  if (!is_ignored || project.request().has_transfer) set_mtf(project, file.parent_path());
  return !is_ignored;
}

// Returns the command files of IMOD's programs for the contrast transfer, which may not be there.
std::array<fs::path, 2> ctf_commands_of(const fs::path& tilt_com) {
  return {command_file_beside(tilt_com, "ctfcorrection"),
          command_file_beside(tilt_com, "ctfplotter")};
}

// Returns the entries of a command file, or none if it is not there.
std::vector<io::CommandEntry> entries_of(const fs::path& file) {
  if (!io::is_file(file)) return {};
  std::vector<io::CommandEntry> entries;
  for (io::Command& command : io::read_command_file(file))
    entries.insert(entries.end(), command.entries.begin(), command.entries.end());
  return entries;
}

// Sets what the commands of some files say of the microscope.
class OpticsOfCommands {
 public:
  OpticsOfCommands(Project& project, const StackPixels& pixels, bool has_transfer)
      : project_(project), pixels_(pixels), has_transfer_(has_transfer) {}

  // Takes an entry. Returns whether it says something of the microscope.
  bool take(const fs::path& file, const io::CommandEntry& entry) {
    const std::string name = lower_case(entry.name);
    warn_of_other_transfer(file, entry, name);
    const auto optics = std::ranges::find(kOptics, name, &Optics::entry);
    if (optics == kOptics.end() || project_.ignores(entry.name)) return false;
    const std::string where = fmt::format("'{}', line {}", file.string(), entry.line);
    const auto number = io::parse_number(entry.value);
    if (!number || *number <= 0)
      throw Error(fmt::format("{}: '{} {}' is not a number above 0: correct it", where, entry.name,
                              io::quote(entry.value)));
    const auto [other, is_new] = values_.emplace(name, Value{*number, where});
    if (is_new) set(*optics, file, entry.name, *number);
    if (other->second.number != *number)
      throw Error(
          fmt::format("{}: {} is {}, and {} in {}: leave one out, or go on with --ignore {}", where,
                      entry.name, *number, other->second.number, other->second.where, entry.name));
    return true;
  }

 private:
  struct Optics {
    std::string_view entry, option;
    bool is_of_transfer;
  };
  static constexpr std::array<Optics, 4> kOptics{
      {{"voltage", "--voltage", false},
       {"sphericalaberration", "--cs", true},
       {"amplitudecontrast", "--amplitude-contrast", true},
       {"pixelsize", "--pixel-size", false}}};
  struct Value {
    double number;
    std::string where;
  };

  void set(const Optics& optics, const fs::path& file, const std::string& entry, double number) {
    if (optics.option == "--pixel-size") {
      const double size_A = kAngstroms_in_nm * number / pixels_.bin;
      set_stated_pixel_size(project_, {file, entry, size_A}, pixels_.in_header_A);
    } else if (has_transfer_ || !optics.is_of_transfer) {
      project_.set(optics.option, fmt::format("{}", number), file, entry);
    }
  }

  // The phase shifts that count are those of the .defocus file.
  void warn_of_other_transfer(const fs::path& file, const io::CommandEntry& entry,
                              const std::string& name) {
    constexpr std::array<std::string_view, 4> kOthers{"degphaseshift", "phaseplateshift",
                                                      "cutonfrequency", "inverttiltangles"};
    if (!has_transfer_ || std::ranges::find(kOthers, name) == kOthers.end()) return;
    const auto number = io::parse_number(entry.value);
    if ((number && *number == 0.0) || project_.ignores(entry.name)) return;
    project_.warn(
        fmt::format("'{}', line {}: {} is not applied (--ignore {} says that this is "
                    "meant)",
                    file.string(), entry.line, io::quote(entry.name), io::quote(entry.name)));
  }

  static constexpr double kAngstroms_in_nm = 10.0;
  Project& project_;
  StackPixels pixels_;
  bool has_transfer_;
  std::map<std::string, Value> values_;  // by the entry
};

}  // namespace

bool set_transfer_files(Project& project, const fs::path& folder, const std::string& name) {
  for (const char* ending : {".defocus", "_CTF.txt", "_ctf.txt", "_ctf.star"}) {
    const fs::path file = folder / (name + ending);
    if (io::is_file(file)) return set_transfer_file(project, file, file);
  }
  if (project.request().has_transfer) set_mtf(project, folder);
  return false;
}

void set_imod_optics(Project& project, const fs::path& tilt_com, const StackPixels& pixels,
                     bool has_transfer) {
  OpticsOfCommands optics(project, pixels, has_transfer);
  for (const fs::path& file : ctf_commands_of(tilt_com)) {
    bool is_used = false;
    for (const io::CommandEntry& entry : entries_of(file))
      is_used = optics.take(file, entry) || is_used;
    if (is_used) project.add_file(file);
  }
}

bool set_imod_transfer(Project& project, const fs::path& tilt_com, const std::string& name) {
  for (const fs::path& com : ctf_commands_of(tilt_com)) {
    for (const io::CommandEntry& entry : entries_of(com)) {
      const fs::path file = com.parent_path() / entry.value;
      if (lower_case(entry.name) != "defocusfile" || !io::is_file(file)) continue;
      return set_transfer_file(project, file, com);
    }
  }
  return set_transfer_files(project, tilt_com.parent_path(), name);
}

}  // namespace tomofield::projects
