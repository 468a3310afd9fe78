#include "projects/transfer_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/is_file.h"
#include "io/tables/alignment_files.h"
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

// A command file with its entries; none if it is not there.
struct CtfCommand {
  fs::path file;
  bool is_fit;  // ctfplotter's
  std::vector<io::CommandEntry> entries;

  CtfCommand(const fs::path& tilt_com, const char* name, bool fits)
      : file(command_file_beside(tilt_com, name)), is_fit(fits) {
    if (!io::is_file(file)) return;
    for (io::Command& command : io::read_command_file(file))
      entries.insert(entries.end(), command.entries.begin(), command.entries.end());
  }
};

// The command files of IMOD's programs for the contrast transfer.
struct CtfCommands {
  CtfCommand correction, plotter;

  explicit CtfCommands(const fs::path& tilt_com)
      : correction(tilt_com, "ctfcorrection", false), plotter(tilt_com, "ctfplotter", true) {}
  std::array<const CtfCommand*, 2> all() const { return {&correction, &plotter}; }
};

// A file with the contrast transfer of the views, and where it is named.
struct NamedTransfer {
  fs::path file, named_in;
};

// A number above 0, or of 0 or more, that an entry of a command file states.
struct StatedNumber {
  fs::path file;
  std::string entry;
  int line;
  double value;

  static StatedNumber of(const fs::path& file, const io::CommandEntry& entry, bool may_be_0) {
    const auto number = io::parse_number(entry.value);
    if (number && (*number > 0 || (may_be_0 && *number == 0)))
      return {file, entry.name, entry.line, *number};
    throw Error(fmt::format("'{}', line {}: '{} {}' is not a number {}: correct it", file.string(),
                            entry.line, entry.name, io::quote(entry.value),
                            may_be_0 ? "of 0 or more" : "above 0"));
  }

  // Throws Error if another entry contradicts this one.
  [[noreturn]] void refuse_other(const StatedNumber& other) const {
    throw Error(fmt::format(
        "'{}', line {}: {} is {}, and {} is {} in '{}', line {}: leave one out, or go on with "
        "--ignore {}",
        file.string(), line, entry, value, other.entry, other.value, other.file.string(),
        other.line, entry));
  }
};

// Returns the number of an entry in a file, if it has it. Throws Error if it has two.
std::optional<StatedNumber> find_stated(Project& project, const CtfCommand& command,
                                        std::string_view name, bool may_be_0 = false) {
  std::optional<StatedNumber> found;
  for (const io::CommandEntry& entry : command.entries) {
    if (lower_case(entry.name) != name || project.ignores(entry.name)) continue;
    const StatedNumber stated = StatedNumber::of(command.file, entry, may_be_0);
    if (found && found->value != stated.value) stated.refuse_other(*found);
    found = stated;
  }
  return found;
}

// Sets what the commands say of the microscope.
void set_microscope(Project& project, const CtfCommands& commands, bool has_transfer) {
  struct Optics {
    std::string_view entry, option;
    bool is_of_transfer;
  };
  constexpr std::array<Optics, 3> kOptics{{{"voltage", "--voltage", false},
                                           {"sphericalaberration", "--cs", true},
                                           {"amplitudecontrast", "--amplitude-contrast", true}}};
  for (const Optics& optics : kOptics) {
    std::optional<StatedNumber> found;
    for (const CtfCommand* command : commands.all()) {
      const auto stated = find_stated(project, *command, optics.entry, optics.is_of_transfer);
      if (!stated) continue;
      if (found && found->value != stated->value) stated->refuse_other(*found);
      if (!found && (has_transfer || !optics.is_of_transfer))
        project.set(optics.option, fmt::format("{}", stated->value), stated->file, stated->entry);
      found = stated;
      project.add_file(stated->file);
    }
  }
}

// Returns the size of unbinned pixels in nm: ctfplotter states that of the raw stack, ctfphaseflip
// that of the aligned one, and beside it UnbinnedPixelSize. Before eTomo has updated the latter's
// command file, it has the size of unbinned pixels, too, or that of an earlier binning: then it is
// not used.
std::optional<StatedNumber> unbinned_pixel_nm(Project& project, const CtfCommands& commands,
                                              double bin) {
  constexpr double kRounding = 0.01;
  const auto differ = [](double a, double b) { return std::fabs(a / b - 1.0) > kRounding; };
  const auto of_raw = find_stated(project, commands.plotter, "pixelsize");
  const auto stated = find_stated(project, commands.correction, "unbinnedpixelsize");
  auto of_aligned = find_stated(project, commands.correction, "pixelsize");
  if (of_raw && stated && differ(of_raw->value, stated->value)) of_raw->refuse_other(*stated);
  const auto& unbinned = of_raw ? of_raw : stated;
  if (unbinned && of_aligned && differ(of_aligned->value, unbinned->value * bin) &&
      differ(of_aligned->value, unbinned->value))
    project.warn(fmt::format(
        "'{}', line {}: PixelSize {} is not used, as {} is {} in '{}', line {} (--ignore PixelSize "
        "says that this is meant)",
        of_aligned->file.string(), of_aligned->line, of_aligned->value, unbinned->entry,
        unbinned->value, unbinned->file.string(), unbinned->line));
  if (unbinned) return unbinned;
  if (of_aligned) of_aligned->value /= bin;
  return of_aligned;
}

void set_imod_pixel_size(Project& project, const CtfCommands& commands, const StackPixels& pixels) {
  constexpr double kAngstroms_in_nm = 10.0;
  const auto stated = unbinned_pixel_nm(project, commands, pixels.bin);
  if (!stated) return;
  const double of_stack = pixels.is_raw ? 1.0 : pixels.bin;
  project.add_file(stated->file);
  set_stated_pixel_size(project,
                        {stated->file, stated->entry, kAngstroms_in_nm * stated->value * of_stack},
                        pixels.in_header_A);
}

// Compares the tilt axis that a command states with that of the alignment.
void compare_axis(Project& project, const CtfCommand& command) {
  for (const io::CommandEntry& entry : command.entries) {
    if (lower_case(entry.name) != "axisangle" || project.ignores(entry.name)) continue;
    const auto axis_deg = io::parse_number(entry.value, base::kLargestAngle_deg);
    if (!axis_deg)
      throw Error(fmt::format(
          "'{}', line {}: '{} {}' is no angle of a tilt axis: correct it, or "
          "go on with --ignore {}",
          command.file.string(), entry.line, entry.name, io::quote(entry.value), entry.name));
    project.add_file(command.file);
    warn_of_other_rotation(project, command.file, entry.name, *axis_deg);
  }
}

// Entries of ctfphaseflip that are used here, or that change the cost of its correction, its files
// or its strength alone. All others change the contrast transfer, or are not known.
constexpr std::array<std::string_view, 26> kKnownOfCorrection{
    "inputstack",          "outputfilename",
    "anglefile",           "defocusfile",
    "transformfile",       "voltage",
    "sphericalaberration", "amplitudecontrast",
    "pixelsize",           "unbinnedpixelsize",
    "axisangle",           "defocustol",
    "interpolationwidth",  "maximumstripwidth",
    "minimumstripwidth",   "usegpu",
    "actionifgpufails",    "scalebyctfpower",
    "scalebypower",        "attenuationfactor",
    "attenuationpower",    "startingendingviews",
    "totalviews",          "boundaryinfo",
    "parameterfile",       "correctwholeimages"};
// Entries of ctfplotter that change the contrast transfer. Its others are of the fit, whose result
// is the .defocus file.
constexpr std::array<std::string_view, 4> kOthersOfFit{"phaseshiftindegrees", "phaseplateshift",
                                                       "cutonfrequency", "inverttiltangles"};

template <std::size_t kCount>
bool is_one_of(const std::array<std::string_view, kCount>& names, std::string_view name) {
  return std::ranges::find(names, name) != names.end();
}

// Returns the tilt about X that the project has set, or 0.
double x_axis_tilt(const Project& project) {
  const auto set = io::parse_number(project.value_of("--x-axis-tilt"));
  return set ? double{*set} : 0.0;
}

// Warns of what changes the contrast transfer and is not applied. The phase shifts that count are
// those of the .defocus file.
void warn_of_other_transfer(Project& project, const CtfCommand& command) {
  for (const io::CommandEntry& entry : command.entries) {
    const std::string name = lower_case(entry.name);
    if (command.is_fit ? !is_one_of(kOthersOfFit, name) : is_one_of(kKnownOfCorrection, name))
      continue;
    const auto number = io::parse_number(entry.value);
    if ((number && *number == 0.0) || project.ignores(entry.name)) continue;
    if (name == "xaxistilt" && number && *number == x_axis_tilt(project)) continue;
    project.warn(fmt::format(
        "'{}', line {}: {} is not applied (--ignore {} says that this is meant)",
        command.file.string(), entry.line, io::quote(entry.name), io::quote(entry.name)));
  }
}

}  // namespace

bool set_transfer_files(Project& project, const fs::path& folder, const std::string& name) {
  std::optional<fs::path> found;
  for (const char* ending : {".defocus", "_CTF.txt", "_ctf.txt", "_ctf.star"}) {
    const fs::path file = folder / (name + ending);
    if (!io::is_file(file)) continue;
    if (found && !project.ignores(kEntryOfCtf))
      project.warn(
          fmt::format("'{}' lies beside '{}', which is read (give the right one with --ctf)",
                      file.string(), found->string()));
    if (!found) found = file;
  }
  if (found) return set_transfer_file(project, *found, *found);
  if (project.request().has_transfer) set_mtf(project, folder);
  return false;
}

bool set_transfer_of_views(Project& project, const io::ViewTable& table, std::string_view entry) {
  io::ViewTable used = table;
  const auto count = static_cast<std::int64_t>(table.views.size());
  for (const std::int64_t section : io::parse_section_list(project.request().exclude, count))
    used.views[static_cast<std::size_t>(section)].is_used = false;
  const bool has_defocus = io::has_defocus(used);
  if (has_defocus) project.set("--ctf", table.file.string(), table.file, entry);
  if (has_defocus || project.request().has_transfer) return has_defocus;
  for (const std::string& what : table.ctf_not_applied)
    project.warn(fmt::format("'{}' has {}, so its contrast transfer is not applied",
                             table.file.string(), what));
  return false;
}

void set_stated_optics(Project& project, const io::StatedOptics& optics, const fs::path& file,
                       const OpticsEntries& entries, bool has_transfer) {
  const auto set = [&](std::string_view option, std::string_view entry,
                       const std::optional<double>& value) {
    if (value) project.set(option, fmt::format("{}", *value), file, entry);
  };
  set("--voltage", entries.voltage, optics.voltage_kV);
  if (!has_transfer) return;
  set("--cs", entries.spherical_aberration, optics.spherical_aberration_mm);
  set("--amplitude-contrast", entries.amplitude_contrast, optics.amplitude_contrast);
}

void set_imod_optics(Project& project, const fs::path& tilt_com, const StackPixels& pixels,
                     bool has_transfer) {
  const CtfCommands commands(tilt_com);
  set_microscope(project, commands, has_transfer);
  set_imod_pixel_size(project, commands, pixels);
  for (const CtfCommand* command : commands.all()) compare_axis(project, *command);
  if (!has_transfer) return;
  for (const CtfCommand* command : commands.all()) warn_of_other_transfer(project, *command);
}

bool set_imod_transfer(Project& project, const fs::path& tilt_com, const std::string& name) {
  const CtfCommands commands(tilt_com);
  std::optional<NamedTransfer> found;
  for (const CtfCommand* command : commands.all()) {
    for (const io::CommandEntry& entry : command->entries) {
      if (lower_case(entry.name) != "defocusfile" || project.ignores(entry.name)) continue;
      const NamedTransfer named{command->file.parent_path() / entry.value, command->file};
      if (!io::is_file(named.file))
        project.warn(
            fmt::format("'{}' has {} {}, which is not there (--ignore {} says that this is "
                        "meant)",
                        command->file.string(), entry.name, io::quote(entry.value), entry.name));
      else if (!found)
        found = named;
      else if (found->file.lexically_normal() != named.file.lexically_normal())
        project.warn(
            fmt::format("'{}' names the defocus file '{}', and '{}' another, '{}': the "
                        "former is read (give the right one with --ctf)",
                        found->named_in.string(), found->file.string(), named.named_in.string(),
                        named.file.string()));
    }
  }
  if (found) return set_transfer_file(project, found->file, found->named_in);
  return set_transfer_files(project, tilt_com.parent_path(), name);
}

}  // namespace tomofield::projects
