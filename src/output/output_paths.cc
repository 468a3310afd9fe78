#include "output/output_paths.h"

#include <string>

namespace tomofield::output {

OutputPaths output_paths(const std::filesystem::path& volume) {
  std::filesystem::path stem = volume;
  stem.replace_extension();
  const auto with = [&](const std::string& extension) {
    return std::filesystem::path(stem.string() + extension);
  };
  const auto of_half = [&](const std::string& name) {
    return OutputPaths::OfHalf{with("_" + name + "_Vol.mrc"), with("_" + name + ".h5"),
                               with("_wbp_" + name + "_Vol.mrc")};
  };
  return {.volume = volume,
          .model = with(".h5"),
          .json = with(".json"),
          .report = with("_report.html"),
          .tree_picture = with("_tree.png"),
          .slice_pictures = {with("_xy.png"), with("_xz.png"), with("_yz.png")},
          .mask_picture = with("_mask.png"),
          .held_out_picture = with("_held_out.png"),
          .choice_picture = with("_choice.png"),
          .dial_picture = with("_denoise.png"),
          .prior_picture = with("_prior.png"),
          .trials = with("_tune.json"),
          .alignment = with("_align.json"),
          .alignment_prefix = with("_align"),
          .alignment_picture = with("_align.png"),
          .alignment_star = with("_align.star"),
          .tomogram_star = with(".star"),
          .portal_alignment = with("_alignment.json"),
          .tiles = with("_tiles.h5"),
          .halves = {of_half("EVN"), of_half("ODD")},
          .fsc_picture = with("_fsc.png"),
          .local_resolution = with("_local_resolution.mrc"),
          .uncertainty = with("_uncertainty.mrc")};
}

std::vector<std::filesystem::path> OutputPaths::pictures() const {
  std::vector<std::filesystem::path> all(slice_pictures.begin(), slice_pictures.end());
  all.push_back(mask_picture);
  return all;
}

}  // namespace tomofield::output
