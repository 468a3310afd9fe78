#include "reconstruct/stale_files.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <string>
#include <vector>

#include "base/log.h"

namespace tomofield::reconstruction {
namespace {

namespace fs = std::filesystem;

// Returns the pictures that only some runs draw.
std::vector<fs::path> optional_pictures(const OutputPaths& paths) {
  return {paths.tree_picture, paths.held_out_picture, paths.choice_picture, paths.fsc_picture};
}

}  // namespace

void remove_stale_files(const ReconstructOptions& options, io::OutputSet& results) {
  if (!options.resolved.overwrite) return;
  const OutputPaths paths = output_paths(options.resolved.output);
  std::vector<fs::path> stale;
  if (!options.chooses_weight()) stale.push_back(paths.dial_picture);
  if (!options.open.prior) stale.push_back(paths.prior_picture);
  for (const fs::path& picture : optional_pictures(paths))
    if (!results.contains(picture)) stale.push_back(picture);
  std::vector<std::string> removed;
  for (const fs::path& picture : stale) {
    if (!fs::is_regular_file(picture)) continue;
    results.remove_old(picture);
    removed.push_back(picture.filename().string());
  }
  if (!removed.empty())
    base::log_info(fmt::format("removes pictures of an earlier run: {}", fmt::join(removed, ", ")));
}

}  // namespace tomofield::reconstruction
