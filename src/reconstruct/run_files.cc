#include "reconstruct/run_files.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <string>

#include "base/check.h"
#include "base/log.h"
#include "checkpoint/checkpoint.h"
#include "exchange/exchange_files.h"
#include "io/images/png.h"
#include "io/saving/output_files.h"
#include "output/output_paths.h"
#include "output/volume.h"

namespace tomofield::reconstruction {
namespace {

void add_half_files(const output::OutputPaths& paths, bool with_linear_volumes,
                    std::vector<std::filesystem::path>& files) {
  files.insert(files.end(), {paths.fsc_picture, paths.local_resolution, paths.uncertainty});
  for (const output::OutputPaths::OfHalf& half : paths.halves) {
    files.insert(files.end(), {half.volume, half.model});
    if (with_linear_volumes) files.push_back(half.linear_volume);
  }
}

// Says whether the run resumes. Without a checkpoint there is nothing to resume: then the other
// files are from another run, unless a run was killed here before its first checkpoint.
bool can_resume(const options::ReconstructOptions& options, const output::OutputPaths& paths) {
  const auto has = [](const std::filesystem::path& file) { return std::filesystem::exists(file); };
  return options.run.resume && (has(paths.model) || io::has_lock_file(paths.volume) ||
                                (options.fit.tune && has(paths.trials)) ||
                                (options.run.align != Alignment::kOff && has(paths.alignment)) ||
                                (options.may_use_tiles() && has(paths.tiles)));
}

// Says what a user can do about results that are there already.
std::string advice_on_old_files(const options::ReconstructOptions& options,
                                const output::OutputPaths& paths) {
  if (options.run.resume)
    return "there is no checkpoint to resume, so give --overwrite to start over and replace it, or "
           "another name with -o";
  options::ReconstructOptions resumed = options;
  resumed.run.resume = true;
  return fmt::format(
      "give --overwrite to replace it, {}or another name with -o",
      can_resume(resumed, paths) ? "--resume to continue the run that made it, " : "");
}

// Returns the files that the run writes.
std::vector<std::filesystem::path> files_of(const options::ReconstructOptions& options,
                                            const output::OutputPaths& paths) {
  std::vector<std::filesystem::path> results{paths.volume, paths.model, paths.json, paths.report};
  if (options.field.tree == TreeKind::kAdaptive) results.push_back(paths.tree_picture);
  if (options.may_use_tiles()) results.push_back(paths.tiles);
  if (options.fit.tune) results.push_back(paths.trials);
  if (options.run.align != Alignment::kOff) results.push_back(paths.alignment);
  if (options.fit.hold_out > 0) results.push_back(paths.held_out_picture);
  if (options.makes_halves()) add_half_files(paths, options.fit.denoising_halves, results);
  if (options.fit.tune || options.open_settings().any()) results.push_back(paths.choice_picture);
  if (options.chooses_weight()) results.push_back(paths.dial_picture);
  if (options.open_settings().prior) results.push_back(paths.prior_picture);
  for (const auto& file : exchange::exchange_files(options)) results.push_back(file);
  for (const auto& picture : paths.pictures()) results.push_back(picture);
  return results;
}

// Returns the pictures that only some runs draw.
std::vector<std::filesystem::path> optional_pictures(const output::OutputPaths& paths) {
  return {paths.tree_picture, paths.held_out_picture, paths.choice_picture,
          paths.fsc_picture,  paths.dial_picture,     paths.prior_picture};
}

}  // namespace

std::vector<std::filesystem::path> result_files(const options::ReconstructOptions& options) {
  if (options.run.output.empty() || !options.has_output) return {};
  const output::OutputPaths paths = output::output_paths(options.run.output);
  std::vector<std::filesystem::path> files = files_of(options, paths);
  if (options.volume.zarr) files.push_back(output::zarr_path(paths.volume));
  return files;
}

std::vector<std::filesystem::path> replaceable_files(const options::ReconstructOptions& options) {
  std::vector<std::filesystem::path> files = result_files(options);
  if (files.empty()) return files;
  for (const auto& picture : optional_pictures(output::output_paths(options.run.output)))
    if (std::ranges::find(files, picture) == files.end()) files.push_back(picture);
  return files;
}

void check_options(const options::ReconstructOptions& options) {
  base::require_no_faults(options.faults());
  if (options.run.output.empty() || !options.has_output) return;
  io::require_volume_name(options.run.output);
  exchange::check_exchange_files(options);
  const output::OutputPaths paths = output::output_paths(options.run.output);
  const bool may_replace = options.run.overwrite || can_resume(options, paths);
  const std::string advice = advice_on_old_files(options, paths);
  const std::vector<std::filesystem::path> inputs = io::input_files(options.files);
  io::check_output_files(files_of(options, paths), inputs, may_replace, advice);
  if (options.run.overwrite) io::require_no_input_is_replaced(optional_pictures(paths), inputs);
  if (options.volume.zarr) output::check_zarr(paths.volume, inputs, may_replace, advice);
}

std::vector<io::OutputLock> claim_outputs(const options::ReconstructOptions& options) {
  const output::OutputPaths paths = output::output_paths(options.run.output);
  std::vector<std::filesystem::path> files{paths.volume, paths.model, paths.json};
  if (options.makes_halves())
    for (const output::OutputPaths::OfHalf& half : paths.halves) files.push_back(half.model);
  if (options.may_use_tiles()) files.push_back(paths.tiles);
  if (options.run.align != Alignment::kOff) files.push_back(paths.alignment);
  if (options.run.output.empty()) files.clear();
  return io::claim_outputs(files, [&] {
    check_options(options);
    if (options.run.resume && std::filesystem::exists(paths.model))
      checkpoint::read_checkpoint([&] { checkpoint::require_state_of_fit(paths.model); });
  });
}

void remove_stale_files(const options::ReconstructOptions& options, io::OutputSet& results) {
  if (!options.run.overwrite) return;
  const output::OutputPaths paths = output::output_paths(options.run.output);
  // The run has drawn these two already.
  const auto is_drawn = [&](const std::filesystem::path& picture) {
    return (picture == paths.dial_picture && options.chooses_weight()) ||
           (picture == paths.prior_picture && options.open_settings().prior);
  };
  std::vector<std::string> removed;
  for (const std::filesystem::path& picture : optional_pictures(paths)) {
    if (results.contains(picture) || is_drawn(picture) || !io::is_png(picture)) continue;
    results.remove_old(picture);
    removed.push_back(picture.filename().string());
  }
  if (!removed.empty())
    base::log_info(fmt::format("removes pictures of an earlier run: {}", fmt::join(removed, ", ")));
}

}  // namespace tomofield::reconstruction
