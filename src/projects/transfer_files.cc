#include "projects/transfer_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>
#include <vector>

#include "io/is_file.h"
#include "io/tables/command_file.h"
#include "io/tables/mtf_table.h"
#include "io/tables/text_lines.h"
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

// Returns the entries of the first command file that is there, or none.
std::vector<io::CommandEntry> entries_of(const fs::path& file) {
  if (!io::is_file(file)) return {};
  std::vector<io::CommandEntry> entries;
  for (io::Command& command : io::read_command_file(file))
    entries.insert(entries.end(), command.entries.begin(), command.entries.end());
  return entries;
}

}  // namespace

bool set_transfer_files(Project& project, const fs::path& folder, const std::string& name) {
  if (project.request().has_transfer) set_mtf(project, folder);
  for (const char* ending : {".defocus", "_CTF.txt", "_ctf.txt", "_ctf.star"}) {
    const fs::path file = folder / (name + ending);
    if (!io::is_file(file)) continue;
    if (project.ignores(kEntryOfCtf)) return false;
    project.set("--ctf", file.string(), file, kEntryOfCtf);
    if (!project.request().has_transfer) set_mtf(project, folder);
    return true;
  }
  return false;
}

void set_imod_optics(Project& project, const fs::path& tilt_com, bool has_transfer) {
  struct Value {
    std::string_view entry, option;
    bool is_of_transfer;
  };
  constexpr std::array<Value, 3> kValues{{{"voltage", "--voltage", false},
                                          {"sphericalaberration", "--cs", true},
                                          {"amplitudecontrast", "--amplitude-contrast", true}}};
  const std::string name = tilt_com.filename().string();
  constexpr std::string_view kTilt = "tilt";
  const std::string axis = name.starts_with(kTilt) ? name.substr(kTilt.size()) : ".com";
  for (const char* program : {"ctfcorrection", "ctfplotter"}) {
    const fs::path file = tilt_com.parent_path() / (program + axis);
    bool is_used = false;
    for (const io::CommandEntry& entry : entries_of(file)) {
      for (const Value& value : kValues) {
        const auto number = io::parse_number(entry.value);
        if (lower_case(entry.name) != value.entry || !number || *number <= 0) continue;
        is_used = true;
        if (has_transfer || !value.is_of_transfer)
          project.set(value.option, fmt::format("{}", *number), file, entry.name);
      }
    }
    if (!is_used) continue;
    project.add_file(file);
    return;
  }
}

}  // namespace tomofield::projects
