#include "reconstruct/options.h"

#include <fmt/format.h>

#include "base/check.h"
#include "output/result_files.h"
#include "reconstruct/tuning.h"

namespace tomofield::reconstruction {

OutputPaths output_paths(const std::filesystem::path& volume) {
  std::filesystem::path stem = volume;
  stem.replace_extension();
  const auto with = [&](const char* extension) {
    return std::filesystem::path(stem.string() + extension);
  };
  return {volume, with(".h5"),           with(".json"),     with("_tree.png"),
          stem,   with("_held_out.png"), with("_tune.json")};
}

int ReconstructOptions::num_trials(int num_fitted_views) const {
  constexpr int kFewestViews = 14;
  if (tune)
    return expected_trials({.penalty = choose_penalty, .rank = field.kind == FieldKind::kVm});
  return choose_penalty && fit.engine == Engine::kSlab && num_fitted_views >= kFewestViews ? 2 : 0;
}

std::vector<std::string> ReconstructOptions::faults() const {
  std::vector<std::string> all = specimen.faults();
  for (const auto& faults : {field.faults(), fit.faults()})
    all.insert(all.end(), faults.begin(), faults.end());
  if (fit.vertex_epochs > 0 && (field.kind != FieldKind::kVm || field.tree != TreeKind::kUniform))
    all.emplace_back(
        "--vertex-epochs is for the factors of a uniform tree: leave it out, or give --field vm "
        "and --tree uniform");
  if (tune && fit.engine == Engine::kRay)
    all.emplace_back("--tune predicts aligned views: it needs --engine slab");
  if (tune && fit.patience > 0)
    all.emplace_back("--tune chooses the number of epochs: leave --early-stop out");
  if (!(checkpoint_minutes >= 0))
    all.push_back(
        fmt::format("--checkpoint-minutes must be 0 or more, not {:g}", checkpoint_minutes));
  return all;
}

std::vector<std::string> ReconstructOptions::faults_of_job() const {
  std::vector<std::string> all;
  const auto refuse = [&](const char* option) {
    all.push_back(fmt::format(
        "several processes cannot share {} yet: start one, with more --threads", option));
  };
  if (field.tree == TreeKind::kAdaptive) refuse("--tree adaptive");
  if (fit.engine == Engine::kRay) refuse("--engine ray");
  return all;
}

void check_options(const ReconstructOptions& options) {
  base::require_no_faults(options.faults());
  const OutputPaths paths = output_paths(options.output);
  // Without a checkpoint there is nothing to resume, and what else is there is not this run's.
  const bool resumes = options.resume && (std::filesystem::exists(paths.model) ||
                                          (options.tune && std::filesystem::exists(paths.trials)));
  std::vector<std::filesystem::path> results{paths.volume, paths.model, paths.json};
  if (options.field.tree == TreeKind::kAdaptive) results.push_back(paths.tree_picture);
  if (options.tune) results.push_back(paths.trials);
  if (options.fit.hold_out > 0) results.push_back(paths.held_out_picture);
  output::check_result_files(
      std::move(results), paths.picture_prefix, options.input, options.overwrite || resumes,
      options.resume ? "there is no checkpoint to resume, so give --overwrite to start over and "
                       "replace it, or another name with -o"
                     : "give --overwrite to replace it, --resume to continue the run that made "
                       "it, or another name with -o");
}

}  // namespace tomofield::reconstruction
