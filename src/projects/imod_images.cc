#include "projects/imod_images.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "io/images/image_stack.h"
#include "io/images/mrc_format.h"
#include "io/is_file.h"
#include "tilt_series/series_plan.h"
#include "tomofield/error.h"

namespace tomofield::projects {

namespace fs = std::filesystem;
using io::is_file;
namespace {

// With these entries of newst.com the aligned stack is more than the transforms of the raw one.
constexpr std::array<std::string_view, 19> kBeyondTransforms{
    "DistortionField", "GradientFile",          "ExpandByFactor",         "ShrinkByFactor",
    "RotateByAngle",   "SectionsToRead",        "ExcludeSections",        "UseTransformLines",
    "FileOfInputs",    "ApplyOffsetsFirst",     "OneTransformPerFile",    "SkipSectionIncrement",
    "WarpingFile",     "ReorderByTiltAngle",    "TwoDirectionTiltSeries", "ReplaceSections",
    "BlankOutput",     "ReverseInputFileOrder", "NumberToOutput"};

// These make no difference to views that this program aligns itself, or to where they lie. It masks
// what IMOD fills and tapers.
constexpr std::array<std::string_view, 16> kHarmless{
    "OutputFile",       "AntialiasFilter", "AdjustOrigin",  "ImagesAreBinned",
    "TaperAtFill",      "FillValue",       "ModeToOutput",  "LinearInterpolation",
    "NearestNeighbor",  "MemoryLimit",     "VerboseOutput", "BytesSignedInOutput",
    "StripExtraHeader", "NumberedFromOne", "ParameterFile", "TestLimits"};

// These say how the aligned stack was made, which is read as it is.
constexpr std::array<std::string_view, 4> kOfRawStack{"InputFile", "TransformFile",
                                                      "SizeToOutputInXandY", "OffsetsInXandY"};

// Programs that change the aligned stack after newstack, as its labels say.
constexpr std::array<std::string_view, 3> kCorrections{"ctfphaseflip", "mtffilter", "ccderaser"};

// A file that an entry names.
struct NamedFile {
  fs::path path;
  fs::path named_in;
  std::string entry;
};

// Returns the file that an entry names, if it is there.
std::optional<NamedFile> find_file(CommandEntries& entries, std::string_view name) {
  const auto path = entries.path(name);
  if (!path || !is_file(*path)) return std::nullopt;
  return NamedFile{*path, entries.file(), std::string(name)};
}

// A raw stack and its transforms.
struct RawFiles {
  NamedFile stack, xf;
};

std::optional<RawFiles> raw_files_of(CommandEntries& newst) {
  const auto stack = find_file(newst, "InputFile");
  const auto xf = find_file(newst, "TransformFile");
  if (!stack || !xf) return std::nullopt;
  return RawFiles{*stack, *xf};
}

// Tells whether the raw stack has pieces of montages, which blend.com aligns: blenda.com for
// tilta.com.
bool is_montage(const fs::path& tilt) {
  std::string name = tilt.filename().string();
  constexpr std::string_view kTilt = "tilt";
  if (name.starts_with(kTilt)) name.replace(0, kTilt.size(), "blend");
  return is_file(tilt.parent_path() / name) && name != tilt.filename().string();
}

// Returns eTomo's name of a dataset by that of its aligned stack: NAME_ali.mrc or NAME.ali.
std::string series_name_of(const fs::path& aligned) {
  std::string name = aligned.filename().string();
  for (const std::string_view end : {"_ali.mrc", ".ali"})
    if (name.ends_with(end)) name.erase(name.size() - end.size());
  return name;
}

// Finds the raw files by eTomo's names: NAME.st or NAME.mrc, and NAME.xf.
std::optional<RawFiles> usual_raw_files(Project& project, CommandEntries& tilt) {
  const auto aligned = tilt.path("InputProjections");
  if (!aligned || project.ignores("TransformFile") || is_montage(tilt.file())) return std::nullopt;
  const std::string name = series_name_of(*aligned);
  const fs::path folder = aligned->parent_path();
  const fs::path xf = folder / (name + ".xf");
  if (!is_file(xf)) return std::nullopt;
  for (const char* extension : {".st", ".mrc"}) {
    const fs::path stack = folder / (name + extension);
    if (is_file(stack) && stack != *aligned) {
      return RawFiles{{stack, tilt.file(), "InputProjections"},
                      {xf, tilt.file(), "InputProjections"}};
    }
  }
  return std::nullopt;
}

// Returns the first entry of newst.com that the raw stack cannot do without, or an empty text.
std::string_view what_hinders_raw(CommandEntries* newst) {
  if (newst == nullptr) return {};
  const auto it =
      std::ranges::find_if(kBeyondTransforms, [&](std::string_view n) { return newst->has(n); });
  return it == kBeyondTransforms.end() ? std::string_view() : *it;
}

// Warns if the aligned stack has corrections that the raw one does not have.
void warn_of_corrections(Project& project, const fs::path& aligned) {
  const auto stack = io::open_image_stack(aligned);
  for (const std::string_view program : kCorrections) {
    if (!io::is_in_labels(stack->header(), program)) continue;
    project.warn(fmt::format(
        "the aligned stack '{}' went through {}, which the raw stack that is read did not: "
        "--ignore TransformFile reads the aligned stack",
        aligned.string(), program));
  }
}

// Says by how much newstack reduces the views, which without an entry it does not.
struct Reduction {
  const char* entry = "BinByFactor";
  double factor = 1.0;
};

// Returns what newst.com says of it; nothing if the user ignores it.
std::optional<Reduction> find_reduction(Project& project, CommandEntries& newst) {
  for (const char* entry : {"BinByFactor", "ShrinkByFactor"})
    if (const auto factor = newst.number(entry)) return Reduction{entry, *factor};
  const bool is_ignored = project.ignores("BinByFactor") || project.ignores("ShrinkByFactor");
  return is_ignored ? std::nullopt : std::optional(Reduction{});
}

// Returns the binning of the aligned stack. Throws Error if the two command files differ.
double find_bin(Project& project, CommandEntries& tilt, CommandEntries* newst, bool is_raw) {
  const auto of_tilt = tilt.number("IMAGEBINNED");
  const auto of_newst = newst == nullptr ? std::nullopt : find_reduction(project, *newst);
  if (!of_tilt && of_newst && of_newst->factor != 1.0 && !project.ignores("IMAGEBINNED"))
    throw Error(fmt::format(
        "'{0}' has {3} {1}, and '{2}' no IMAGEBINNED, so that tilt counts lengths in binned "
        "pixels: write IMAGEBINNED {1} and lengths in unbinned pixels into it, or go on with "
        "--ignore IMAGEBINNED if they are that",
        newst->file().string(), of_newst->factor, tilt.file().string(), of_newst->entry));
  if (of_tilt && of_newst && *of_tilt != of_newst->factor) {
    throw Error(fmt::format(
        "'{0}' has {4} {1} and '{2}' IMAGEBINNED {3}, so lengths cannot be told: align the stack "
        "again in eTomo, or go on with --ignore {4} or --ignore IMAGEBINNED",
        newst->file().string(), of_newst->factor, tilt.file().string(), *of_tilt, of_newst->entry));
  }
  const double bin = of_newst ? of_newst->factor : of_tilt.value_or(1.0);
  if (!(bin >= 1))
    throw Error(fmt::format("'{}': binning by {} is not 1 or more", tilt.file().string(), bin));
  if (is_raw && (of_tilt || bin != 1.0)) {
    const bool is_of_newst = of_newst.has_value();
    project.set("--bin", fmt::format("{}", bin), is_of_newst ? newst->file() : tilt.file(),
                is_of_newst ? of_newst->entry : "IMAGEBINNED");
  }
  return bin;
}

// Warns if newst.com makes another stack than tilt.com reads.
void warn_of_other_series(Project& project, CommandEntries& tilt, CommandEntries* newst) {
  const auto read = tilt.path("InputProjections");
  const auto made = newst == nullptr ? std::nullopt : newst->path("OutputFile");
  if (!read || !made || series_name_of(*read) == series_name_of(*made)) return;
  project.warn(fmt::format(
      "'{}' makes '{}' and '{}' reads '{}': are both of one series? (--ignore OutputFile says that "
      "they are)",
      newst->file().string(), made->filename().string(), tilt.file().string(),
      read->filename().string()));
}

// Fills in how the aligned stack that newst.com makes of a raw one lies over the views. Without a
// size, newstack makes it as large as the raw stack.
void place_aligned_stack(CommandEntries& newst, const io::MrcHeader& raw, ImodImages& images) {
  const std::array raw_size{std::floor(static_cast<double>(raw.nx) / images.bin),
                            std::floor(static_cast<double>(raw.ny) / images.bin)};
  const auto size = newst.numbers("SizeToOutputInXandY", 2, 2, raw_size);
  images.imod_width = (size ? size->at(0) : raw_size[0]) * images.bin;
  images.imod_height = (size ? size->at(1) : raw_size[1]) * images.bin;
  images.size_entry = size ? "SizeToOutputInXandY" : "the size of the raw stack";
  if (const auto offset = newst.numbers("OffsetsInXandY", 2, 2, std::array{0.0, 0.0})) {
    images.imod_offset_x = offset->at(0);
    images.imod_offset_y = offset->at(1);
  }
}

// Does the same without newst.com. FULLIMAGE is the size of the aligned stack, or, with
// SUBSETSTART, that of the whole views of which it is a part. Then its own size is known if it is
// there.
void place_aligned_part(CommandEntries& tilt, ImodImages& images) {
  const auto full = tilt.sizes("FULLIMAGE");
  if (!full) return;
  images.size_entry = "FULLIMAGE";
  images.imod_width = full->at(0);
  images.imod_height = full->at(1);
  const auto start = tilt.numbers("SUBSETSTART", 2, 2, std::array{0.0, 0.0});
  if (!start || (start->at(0) == 0 && start->at(1) == 0)) return;
  const auto aligned = find_file(tilt, "InputProjections");
  if (!aligned) {
    throw Error(fmt::format(
        "'{}' has SUBSETSTART, and neither newst.com nor the aligned stack is there to tell which "
        "part of the views it means: put one of them beside it, or reconstruct whole views with "
        "--ignore SUBSETSTART",
        tilt.file().string()));
  }
  const auto stack = io::open_image_stack(aligned->path);
  images.size_entry = "FULLIMAGE, SUBSETSTART";
  images.imod_width = static_cast<double>(stack->header().nx) * images.bin;
  images.imod_height = static_cast<double>(stack->header().ny) * images.bin;
  images.imod_offset_x = start->at(0) + images.imod_width / 2 - full->at(0) / 2;
  images.imod_offset_y = start->at(1) + images.imod_height / 2 - full->at(1) / 2;
}

ImodImages read_raw(Project& project, const RawFiles& raw, CommandEntries& tilt,
                    CommandEntries* newst) {
  const auto stack = io::open_image_stack(raw.stack.path);
  const auto size = tilt_series::aligned_size(raw.xf.path, *stack);
  project.set("stack", raw.stack.path.string(), raw.stack.named_in, raw.stack.entry);
  project.set("--xf", raw.xf.path.string(), raw.xf.named_in, raw.xf.entry);
  ImodImages images;
  images.stack = raw.stack.path;
  images.num_sections = stack->header().nz;
  images.pixel_size_A = stack->header().voxel_size_A[0];
  images.is_raw = true;
  images.series_name = series_name_of(tilt.path("InputProjections").value_or(fs::path()));
  images.bin = find_bin(project, tilt, newst, true);
  images.has_newst = newst != nullptr;
  images.width = images.imod_width = static_cast<double>(size[0]);
  images.height = images.imod_height = static_cast<double>(size[1]);
  if (newst != nullptr)
    place_aligned_stack(*newst, stack->header(), images);
  else
    place_aligned_part(tilt, images);
  if (const auto aligned = find_file(tilt, "InputProjections"))
    warn_of_corrections(project, aligned->path);
  return images;
}

ImodImages read_aligned(Project& project, const NamedFile& aligned, CommandEntries& tilt,
                        CommandEntries* newst) {
  const auto stack = io::open_image_stack(aligned.path);
  project.set("stack", aligned.path.string(), aligned.named_in, aligned.entry);
  ImodImages images;
  images.stack = aligned.path;
  images.num_sections = stack->header().nz;
  images.pixel_size_A = stack->header().voxel_size_A[0];
  images.series_name = series_name_of(tilt.path("InputProjections").value_or(fs::path()));
  images.is_phase_flipped = io::is_phase_flipped(stack->header());
  images.bin = images.unit = find_bin(project, tilt, newst, false);
  images.width = images.imod_width = static_cast<double>(stack->header().nx) * images.unit;
  images.height = images.imod_height = static_cast<double>(stack->header().ny) * images.unit;
  if (newst != nullptr) newst->know(kOfRawStack);
  return images;
}

// Warns of files that newst.com names and that are not there: others are read.
void warn_of_absent(Project& project, CommandEntries* newst, const std::string& instead) {
  if (newst == nullptr) return;
  for (const char* entry : {"InputFile", "TransformFile"}) {
    const auto path = newst->path(entry);
    if (!path || is_file(*path) || project.ignores(entry)) continue;
    project.warn(fmt::format(
        "'{}' has {} {}, which is not there: {} is read (--ignore {} says that this is meant)",
        newst->file().string(), entry, path->filename().string(), instead, entry));
  }
}

}  // namespace

ImodImages choose_imod_images(Project& project, CommandEntries& tilt, CommandEntries* newst) {
  const std::string_view hindrance = what_hinders_raw(newst);
  std::optional<RawFiles> raw;
  if (newst != nullptr && hindrance.empty()) raw = raw_files_of(*newst);
  if (!raw && hindrance.empty()) raw = usual_raw_files(project, tilt);
  const auto aligned = find_file(tilt, "InputProjections");
  warn_of_other_series(project, tilt, newst);
  if (newst != nullptr) newst->know(kHarmless);
  // Results must not replace the images of the project, whichever of them are read.
  if (aligned) project.add_file(aligned->path);
  if (raw) project.add_file(raw->stack.path);
  if (const auto named = newst == nullptr ? std::nullopt : find_file(*newst, "InputFile"))
    project.add_file(named->path);
  if (raw) {
    warn_of_absent(project, newst,
                   fmt::format("'{}' with '{}'", raw->stack.path.filename().string(),
                               raw->xf.path.filename().string()));
    return read_raw(project, *raw, tilt, newst);
  }
  if (aligned) {
    warn_of_absent(project, newst,
                   fmt::format("the aligned stack '{}'", aligned->path.filename().string()));
    if (!hindrance.empty()) {
      project.warn(fmt::format("'{}' has {}, so the aligned stack is read, and not the raw one",
                               newst->file().string(), hindrance));
    }
    return read_aligned(project, *aligned, tilt, newst);
  }
  throw Error(fmt::format(
      "'{}': {}, and the aligned stack (InputProjections {}) is not there either: put one of them "
      "beside it, or give a stack itself with its options",
      tilt.file().string(),
      hindrance.empty()
          ? "the raw stack or its transforms are not there"
          : fmt::format("the raw stack cannot be read as newst.com has {}", hindrance),
      tilt.text("InputProjections").value_or("is not named")));
}

}  // namespace tomofield::projects
