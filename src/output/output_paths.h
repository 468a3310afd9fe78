#pragma once

#include <array>
#include <filesystem>
#include <vector>

namespace tomofield::output {

/// The pictures of the planes across Z, Y and X: xy, xz and yz.
using SlicePaths = std::array<std::filesystem::path, 3>;

/// The files of a reconstruction or a baseline, which are named after its volume.
struct OutputPaths {
  std::filesystem::path volume, model, json;
  std::filesystem::path report;            ///< a page to look at (HTML)
  std::filesystem::path tree_picture;      ///< for adaptive trees
  SlicePaths slice_pictures;               ///< the central planes of the volume
  std::filesystem::path mask_picture;      ///< what is masked in a view
  std::filesystem::path held_out_picture;  ///< if views are held out
  std::filesystem::path choice_picture;    ///< of the trials, if there are any
  std::filesystem::path dial_picture;      ///< what --denoise does (report/denoise_dial.h)
  std::filesystem::path prior_picture;     ///< what the learned prior does (report/pictures.h)
  std::filesystem::path trials;            ///< trials of --tune (JSON)
  std::filesystem::path alignment;         ///< of --align, from which a run resumes (JSON)
  /// The files of an aligned series for IMOD and AreTomo begin with this.
  std::filesystem::path alignment_prefix;
  std::filesystem::path alignment_picture;
  std::filesystem::path alignment_star;    ///< for views of RELION
  std::filesystem::path tomogram_star;     ///< for tomograms of RELION
  std::filesystem::path portal_alignment;  ///< for the CryoET Data Portal (JSON)
  std::filesystem::path tiles;  ///< finished tiles, from which a run resumes (a compact model)
  /// Files of one of two halves.
  struct OfHalf {
    std::filesystem::path volume, model;
    std::filesystem::path linear_volume;  ///< with --denoising-halves
  };
  std::array<OfHalf, 2> halves;                                      ///< [tilt_series::Half]
  std::filesystem::path fsc_picture, local_resolution, uncertainty;  ///< of the halves

  /// Returns the pictures that every run draws.
  std::vector<std::filesystem::path> pictures() const;
};
/// Returns the paths of the files beside `volume`.
OutputPaths output_paths(const std::filesystem::path& volume);

}  // namespace tomofield::output
