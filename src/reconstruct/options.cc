#include "reconstruct/options.h"

#include <fmt/format.h>

#include "base/check.h"
#include "fit/integer_program.h"
#include "io/output_files.h"
#include "option_table/values.h"
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
  if (resolved.tune)
    return expected_trials({.penalty = choose_penalty, .rank = field.kind == FieldKind::kVm});
  return choose_penalty && fit.engine == Engine::kSlab && num_fitted_views >= kFewestViews ? 2 : 0;
}

std::vector<std::string> ReconstructOptions::faults() const {
  std::vector<std::string> all = option_table::range_faults(resolved);
  const auto refuse_if = [&](bool is_fault, const char* sentence) {
    if (is_fault) all.emplace_back(sentence);
  };
  const bool is_ray = fit.engine == Engine::kRay;
  refuse_if(field.tree == TreeKind::kAdaptive && !fit::can_solve_integer_programs(),
            "--tree adaptive needs COIN-OR CBC, and this tomofield was built without it: take "
            "--tree uniform, or build tomofield with -DTOMOFIELD_WITH_CBC=ON");
  refuse_if(field.leaf_budget > 0 && field.tree == TreeKind::kUniform,
            "--leaf-budget is for --tree adaptive alone");
  refuse_if(fit.vertex_epochs > 0 && is_ray,
            "--vertex-epochs needs --engine slab: with rays factors are fitted from the start");
  refuse_if(
      fit.vertex_epochs > 0 && (field.kind != FieldKind::kVm || field.tree != TreeKind::kUniform),
      "--vertex-epochs is for the factors of a uniform tree: leave it out, or give --field "
      "vm and --tree uniform");
  refuse_if(fit.patience > 0 && fit.hold_out == 0,
            "--early-stop watches views that --hold-out keeps from the fit: give that as well");
  refuse_if(fit.hold_out > 0 && is_ray,
            "--hold-out predicts aligned views: it needs --engine slab");
  refuse_if(resolved.tune && is_ray, "--tune predicts aligned views: it needs --engine slab");
  refuse_if(resolved.tune && fit.patience > 0,
            "--tune chooses the number of epochs: leave --early-stop out");
  refuse_if(resolved.resume && resolved.output.empty(),
            "--resume continues from the files of an interrupted run: give their output");
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
  if (options.resolved.output.empty()) return;
  const Options& resolved = options.resolved;
  const OutputPaths paths = output_paths(resolved.output);
  // Without a checkpoint there is nothing to resume: other files are not this run's.
  const bool resumes =
      resolved.resume && (std::filesystem::exists(paths.model) ||
                          (resolved.tune && std::filesystem::exists(paths.trials)));
  std::vector<std::filesystem::path> results{paths.volume, paths.model, paths.json};
  if (options.field.tree == TreeKind::kAdaptive) results.push_back(paths.tree_picture);
  if (resolved.tune) results.push_back(paths.trials);
  if (options.fit.hold_out > 0) results.push_back(paths.held_out_picture);
  io::check_result_files(
      std::move(results), paths.picture_prefix, options.files, resolved.overwrite || resumes,
      resolved.resume ? "there is no checkpoint to resume, so give --overwrite to start over and "
                        "replace it, or another name with -o"
                      : "give --overwrite to replace it, --resume to continue the run that made "
                        "it, or another name with -o");
}

}  // namespace tomofield::reconstruction
