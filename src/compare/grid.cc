#include "compare/grid.h"

#include <fmt/format.h>

#include "evaluate/volume_pair.h"
#include "io/images/mrc.h"
#include "io/images/mrc_format.h"
#include "tomofield/error.h"

namespace tomofield::compare {
namespace {

std::string to_text(const Grid& grid) {
  return fmt::format(
      "{} × {} × {} voxels{}", grid.size[0], grid.size[1], grid.size[2],
      io::is_known_size(grid.voxel_A) ? fmt::format(" of {:.4g} Å", grid.voxel_A) : "");
}

}  // namespace

Grid read_grid(const std::filesystem::path& mrc) {
  const io::MrcReader file(mrc);
  const io::MrcHeader& header = file.header();
  return {{header.nx, header.ny, header.nz}, io::cubic_voxel_size_A(header, mrc)};
}

void require_one_grid(const NamedGrid& main, const NamedGrid& other) {
  constexpr double kRounding = 1e-3;  // rounding of a plan's four digits
  if (main.grid.size == other.grid.size &&
      !evaluate::voxel_sizes_differ(other.grid.voxel_A, main.grid.voxel_A, kRounding))
    return;
  throw Error(
      fmt::format("{} gives {} and {} gives {}: a comparison needs volumes of one size; give "
                  "--roi, --bin and --angpix to compare itself, and leave them and --axes out of "
                  "--also",
                  other.name, to_text(other.grid), main.name, to_text(main.grid)));
}

void require_truth_fits(const std::filesystem::path& truth, const NamedGrid& main, bool is_a_part) {
  const Grid grid = read_grid(truth);
  if (!evaluate::voxel_sizes_differ(main.grid.voxel_A, grid.voxel_A,
                                    evaluate::kMaxScaleDifference) &&
      !evaluate::have_axes_in_another_order(main.grid.size, grid.size) &&
      (is_a_part || evaluate::share_half(main.grid.size, grid.size)))
    return;
  throw Error(
      fmt::format("the truth '{}' has {} and {} gives {}: give a truth of the same region, voxels "
                  "and axes, or change --roi, --thickness, --bin or --pixel-size",
                  truth.string(), to_text(grid), main.name, to_text(main.grid)));
}

}  // namespace tomofield::compare
