#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "io/is_file.h"
#include "io/tables/alignment_files.h"
#include "io/tables/ctf_table.h"
#include "io/tables/text_lines.h"
#include "projects/command_entries.h"
#include "projects/formats.h"
#include "projects/imod_images.h"
#include "projects/imod_volume.h"
#include "projects/transfer_files.h"
#include "tomofield/error.h"

namespace tomofield::projects {

namespace fs = std::filesystem;
namespace {

// These choose how IMOD's tilt back-projects, filters and writes; this program's fit has options of
// its own for what it has of them.
constexpr std::array<std::string_view, 38> kHarmless{"OutputFile",
                                                     "ReferenceSDofScaling",
                                                     "AdjustOrigin",
                                                     "RADIAL",
                                                     "FalloffIsTrueSigma",
                                                     "SCALE",
                                                     "PERPENDICULAR",
                                                     "RotateBy90",
                                                     "MODE",
                                                     "TITLE",
                                                     "ActionIfGPUFails",
                                                     "UseGPU",
                                                     "COSINTERP",
                                                     "FBPINTERP",
                                                     "XTILTINTERP",
                                                     "DENSWEIGHT",
                                                     "FlatFilterFraction",
                                                     "FakeSIRTiterations",
                                                     "SIRTIterations",
                                                     "SIRTSubtraction",
                                                     "StartingIteration",
                                                     "ConstrainSign",
                                                     "InternalSIRTSlices",
                                                     "LeaveIterations",
                                                     "HammingLikeFilter",
                                                     "ExactFilterSize",
                                                     "MASK",
                                                     "MinMaxMean",
                                                     "WeightAngleFile",
                                                     "COMPFRACTION",
                                                     "DebugOutput",
                                                     "ParameterFile",
                                                     "DONE",
                                                     "VertForSIRTInput",
                                                     "VertSliceOutputFile",
                                                     "VertBoundaryFile",
                                                     "BoundaryInfoFile"};

// An entry without which the reconstruction is another one.
struct Refusal {
  std::string_view entry, why;
};
constexpr Refusal kRefusals[] = {
    {"ANGLES", "lists the tilt angles in the command file: put them into a .tlt file (--tlt)"},
    {"COMPRESS", "compresses the specimen view by view, which this program cannot do"},
    {"REPLICATE", "repeats views at other angles, which this program cannot do"},
    {"REPROJECT", "projects a volume instead of reconstructing one"},
    {"RecFileToReproject", "projects a volume instead of reconstructing one"},
    {"ProjectModel", "projects a model instead of reconstructing a volume"},
    {"BaseRecFile", "adds to an earlier volume, which this program cannot do"},
    {"TOTALSLICES", "belongs to one part of a volume: give the command file of the whole"},
};

// Returns newst.com for tilt.com, newsta.com for tilta.com, or nothing if it is not there.
std::optional<fs::path> find_newst(const fs::path& tilt) {
  const fs::path newst = command_file_beside(tilt, "newst");
  std::error_code absent;
  if (!fs::exists(newst, absent)) return std::nullopt;
  return newst;
}

void warn_of_what_differs(Project& project, CommandEntries& tilt) {
  if (tilt.has("PARALLEL")) {
    project.warn(
        fmt::format("'{}': PARALLEL mirrors the volume, and this program does not (--axes "
                    "and --hand say how it lies)",
                    tilt.file().string()));
  }
  if (tilt.has("WeightFile")) {
    project.warn(fmt::format("'{}': WeightFile is not applied: the fit weights each view itself",
                             tilt.file().string()));
  }
}

// Says what the factors of ZFACTORFILE do: each view is shifted in proportion to the height in the
// specimen.
std::string effect_of_z_factors(CommandEntries& tilt) {
  const fs::path path = tilt.path("ZFACTORFILE").value_or(fs::path());
  std::string effect = "shifts the views in proportion to the height, which this program cannot do";
  const auto thickness = tilt.number("THICKNESS");
  if (!thickness || !io::is_file(path)) return effect;
  double largest = 0.0;
  for (const io::TextLine& line : io::read_text_lines(path))
    for (const std::string_view word : io::split_words(line.text))
      if (const auto number = io::parse_number(word))
        largest = std::max(largest, std::abs(*number));
  return fmt::format("{}: by up to {:.2g} pixels at the faces of the specimen", effect,
                     largest * *thickness / 2);
}

// Refuses all entries at once without which the reconstruction is another one.
void refuse_what_is_missing(Project& project, CommandEntries& tilt) {
  std::vector<std::string> faults;
  std::vector<std::string_view> entries;
  const auto refuse = [&](std::string_view entry, std::string_view why) {
    const auto fault = tilt.fault_of(entry, why);
    if (!fault) return;
    faults.push_back(*fault);
    entries.push_back(entry);
  };
  for (const Refusal& refusal : kRefusals) refuse(refusal.entry, refusal.why);
  if (tilt.has("ZFACTORFILE")) refuse("ZFACTORFILE", effect_of_z_factors(tilt));
  if (const auto local = tilt.path("LOCALFILE"); local && !io::is_file(*local)) {
    refuse("LOCALFILE",
           fmt::format("names the local alignments '{}', which are not there", local->string()));
  }
  if (const auto xtilt = tilt.path("XTILTFILE"); xtilt && !io::is_file(*xtilt)) {
    refuse("XTILTFILE",
           fmt::format("names the x-axis tilts '{}', which are not there", xtilt->string()));
  }
  if (!faults.empty()) {
    throw Error(fmt::format("'{}', {}; --ignore {} goes on without {}", tilt.file().string(),
                            fmt::join(faults, "; "), fmt::join(entries, ","),
                            faults.size() == 1 ? "it" : "them"));
  }
  warn_of_what_differs(project, tilt);
}

// Refuses local alignments whose places count in another image than that of the views that are
// read: in whole views (FULLIMAGE), of which an aligned stack may be a part from SUBSETSTART on.
void require_place_of_local(CommandEntries& tilt, const ImodImages& images) {
  constexpr double kLargestPart = 0.05;  // of the views: parts are larger
  const auto full = tilt.sizes("FULLIMAGE");
  if (!full) return;
  const auto start = tilt.numbers("SUBSETSTART", 2, 2, std::array{0.0, 0.0});
  const double off_x = images.is_raw ? (full->at(0) - images.width) / 2 : start ? start->at(0) : 0;
  const double off_y = images.is_raw ? (full->at(1) - images.height) / 2 : start ? start->at(1) : 0;
  if (std::abs(off_x) <= kLargestPart * images.width &&
      std::abs(off_y) <= kLargestPart * images.height)
    return;
  throw Error(fmt::format(
      "'{}': the places of LOCALFILE count in images of {} × {} pixels (FULLIMAGE), and the views "
      "of '{}' begin {:.4g}, {:.4g} pixels from there, so that parts would move beside their "
      "places: put a stack of whole views beside it, or go on without them with --ignore LOCALFILE",
      tilt.file().string(), full->at(0), full->at(1), images.stack.string(), off_x, off_y));
}

// Sets the local alignments, unless they are the transforms of the whole views, which AreTomo
// writes there.
void set_local(Project& project, CommandEntries& tilt, CommandEntries* newst,
               const ImodImages& images) {
  const auto local = tilt.text("LOCALFILE");
  if (!local || !io::is_file(*tilt.path("LOCALFILE"))) return;
  if (newst != nullptr && newst->text("TransformFile") == local) {
    project.warn(
        fmt::format("'{}': LOCALFILE names the transforms of the whole views, as AreTomo "
                    "writes it; they are applied once",
                    tilt.file().string()));
    return;
  }
  require_place_of_local(tilt, images);
  project.set("--local", tilt.path("LOCALFILE")->string(), tilt.file(), "LOCALFILE");
}

void set_angles(Project& project, CommandEntries& tilt) {
  for (const char* name : {"TILTFILE", "AngleFile"}) {
    if (const auto tlt = tilt.path(name)) {
      project.set("--tlt", tlt->string(), tilt.file(), name);
      break;
    }
  }
  if (const auto xtilt = tilt.path("XTILTFILE"))
    project.set("--xtilt", xtilt->string(), tilt.file(), "XTILTFILE");
  const auto x_axis_tilt = tilt.number("XAXISTILT");
  if (x_axis_tilt.value_or(0) != 0)
    project.set("--x-axis-tilt", fmt::format("{}", *x_axis_tilt), tilt.file(), "XAXISTILT");
}

// Joins lists of sections that are separated by commas or white space.
std::string joined_lists(const std::vector<std::string>& lists) {
  std::string all = fmt::format("{}", fmt::join(lists, ","));
  std::ranges::replace(all, ',', ' ');
  return fmt::format("{}", fmt::join(io::split_words(all), ","));
}

// Returns the sections that are not in the list, as a list.
std::string all_but(const std::string& included, std::int64_t num_sections) {
  const auto kept = io::parse_section_list(included, num_sections);
  std::vector<std::int64_t> others;
  for (std::int64_t section = 0; section < num_sections; ++section)
    if (!std::ranges::binary_search(kept, section)) others.push_back(section + 1);
  return fmt::format("{}", fmt::join(others, ","));
}

void set_excluded(Project& project, CommandEntries& tilt, std::int64_t num_sections) {
  std::vector<std::string> lists, names;
  for (const char* name : {"EXCLUDE", "EXCLUDELIST", "EXCLUDELIST2"}) {
    const auto found = tilt.texts(name);
    if (!found.empty()) names.emplace_back(name);
    lists.insert(lists.end(), found.begin(), found.end());
  }
  const auto included = tilt.texts("INCLUDE");
  if (!included.empty() && !names.empty()) {
    throw Error(fmt::format("'{}' has both INCLUDE and {}: leave one out (--ignore)",
                            tilt.file().string(), names.front()));
  }
  const std::string excluded =
      included.empty() ? joined_lists(lists) : all_but(joined_lists(included), num_sections);
  if (excluded.empty()) return;
  io::parse_section_list(excluded, num_sections);
  project.set("--exclude", excluded, tilt.file(),
              included.empty() ? fmt::format("{}", fmt::join(names, ", ")) : "INCLUDE");
}

// Warns of directions in the raw stack, against which the aligned one is turned.
void warn_of_astigmatism(Project& project, const ImodImages& images) {
  constexpr double kLeast_A = 1.0;
  const fs::path file = project.value_of("--ctf");
  if (images.is_raw || file.empty()) return;
  const auto is_astigmatic = [](const std::optional<io::Defocus>& view) {
    return view && std::abs(view->u_A - view->v_A) > kLeast_A;
  };
  if (std::ranges::none_of(io::read_ctf(file).views, is_astigmatic)) return;
  project.warn(
      fmt::format("'{}' has the directions of astigmatism in the raw stack, and the aligned stack "
                  "'{}' is read, which is turned against it: they are taken as they are",
                  file.string(), images.stack.string()));
}

void set_intensities(Project& project, CommandEntries& tilt) {
  if (!tilt.text("LOG")) return;
  const double base = tilt.number("LOG").value_or(0.0);  // "LOG /" stands for 0
  project.set("--log", "true", tilt.file(), "LOG");
  if (base != 0) project.set("--log-base", fmt::format("{}", base), tilt.file(), "LOG");
}

}  // namespace

void read_imod_project(Project& project) { read_imod_project(project, project.request().path); }

void read_imod_project(Project& project, const fs::path& tilt_com) {
  CommandEntries tilt(project, tilt_com, "tilt");
  std::optional<CommandEntries> newst_com;
  if (const auto path = find_newst(tilt.file())) newst_com.emplace(project, *path, "newstack");
  CommandEntries* newst = newst_com ? &*newst_com : nullptr;
  refuse_what_is_missing(project, tilt);
  const ImodImages images = choose_imod_images(project, tilt, newst);
  set_angles(project, tilt);
  set_local(project, tilt, newst, images);
  set_imod_volume(project, tilt, images);
  set_excluded(project, tilt, images.num_sections);
  set_intensities(project, tilt);
  const bool has_defocus = set_imod_transfer(project, tilt.file(), images.series_name);
  if (has_defocus && images.is_phase_flipped)
    project.set("--ctf-phase-flipped", "true", images.stack, "ctfphaseflip");
  if (has_defocus) warn_of_astigmatism(project, images);
  if (!images.is_raw && images.bin != 1.0 && !project.value_of("--mtf").empty())
    project.warn(fmt::format(
        "'{}' counts for pixels as they were recorded, and those of '{}' are binned by {}: the "
        "detector's transfer is taken as if they were not",
        project.value_of("--mtf"), images.stack.string(), images.bin));
  const StackPixels pixels{images.pixel_size_A, images.bin, images.is_raw};
  set_imod_optics(project, tilt.file(), pixels, has_defocus || project.request().has_transfer);
  tilt.know(kHarmless);
  tilt.warn_about_others();
  if (newst != nullptr) newst->warn_about_others();
}

}  // namespace tomofield::projects
