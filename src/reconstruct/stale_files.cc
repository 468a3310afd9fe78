#include "reconstruct/stale_files.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <string>
#include <vector>

#include "base/log.h"
#include "io/ome_zarr.h"
#include "io/output_files.h"
#include "output/volume.h"
#include "reconstruct/portal_alignment.h"

namespace tomofield::reconstruction {
namespace {

namespace fs = std::filesystem;

// Returns the files that runs put among their results when these are complete.
std::vector<fs::path> optional_results(const OutputPaths& paths) {
  std::vector<fs::path> files{paths.report,           paths.tree_picture,
                              paths.held_out_picture, paths.choice_picture,
                              paths.fsc_picture,      paths.local_resolution,
                              paths.uncertainty,      portal_alignment_path(paths.volume)};
  for (const char* picture : io::kPicturesOfVolume)
    files.emplace_back(paths.picture_prefix.string() + picture);
  for (const OutputPaths::OfHalf& half : paths.halves)
    files.insert(files.end(), {half.volume, half.linear_volume});
  return files;
}

// Returns the files that runs write before that, and that this run has not written.
std::vector<fs::path> others_of_its_course(const ReconstructOptions& options,
                                           const OutputPaths& paths) {
  std::vector<fs::path> files;
  if (!options.resolved.tune) files.push_back(paths.trials);
  if (!options.chooses_weight()) files.push_back(paths.dial_picture);
  if (!options.may_use_tiles()) files.push_back(paths.tiles);
  if (!options.makes_halves())
    for (const OutputPaths::OfHalf& half : paths.halves) files.push_back(half.model);
  return files;
}

}  // namespace

void remove_stale_files(const ReconstructOptions& options, io::OutputSet& results) {
  if (!options.resolved.overwrite) return;
  const OutputPaths paths = output_paths(options.resolved.output);
  std::vector<fs::path> stale = others_of_its_course(options, paths);
  for (const fs::path& file : optional_results(paths))
    if (!results.contains(file)) stale.push_back(file);
  std::vector<std::string> removed;
  for (const fs::path& file : stale) {
    if (!fs::is_regular_file(file) || io::is_input(file, io::input_files(options.files))) continue;
    results.remove_old(file);
    removed.push_back(file.filename().string());
  }
  const fs::path zarr = output::zarr_path(paths.volume);
  if (!options.volume.zarr && fs::exists(zarr / io::kZarrMarker)) {
    results.remove_old_folder(zarr);
    removed.push_back(zarr.filename().string());
  }
  if (!removed.empty())
    base::log_info(
        fmt::format("removes what an earlier run has left: {}", fmt::join(removed, ", ")));
}

}  // namespace tomofield::reconstruction
