#include "compare/grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <regex>

#include "base/check.h"
#include "io/mrc.h"
#include "tomofield/error.h"

namespace tomofield::compare {
namespace {

bool is_known(double voxel_A) { return voxel_A > 0 && voxel_A != 1.0; }

bool voxels_differ(const Grid& a, const Grid& b, double tolerance) {
  return is_known(a.voxel_A) && is_known(b.voxel_A) &&
         std::abs(a.voxel_A - b.voxel_A) > tolerance * b.voxel_A;
}

std::string to_text(const Grid& grid) {
  return fmt::format("{} × {} × {} voxels{}", grid.size[0], grid.size[1], grid.size[2],
                     is_known(grid.voxel_A) ? fmt::format(" of {:.4g} Å", grid.voxel_A) : "");
}

bool has_axes_in_another_order(const Grid& a, const Grid& b) {
  return a.size != b.size && std::ranges::is_permutation(a.size, b.size);
}

// Centre on centre, along some axis.
bool covers_less_than_half(const Grid& volume, const Grid& truth) {
  return !std::ranges::equal(volume.size, truth.size,
                             [](std::int64_t a, std::int64_t b) { return 2 * a >= b; });
}

}  // namespace

Grid read_grid(const std::filesystem::path& mrc) {
  const io::MrcReader file(mrc);
  const io::MrcHeader& header = file.header();
  return {{header.nx, header.ny, header.nz}, header.voxel_size_A[0]};
}

Grid planned_grid(const std::string& said) {
  static const std::regex sizes(", ([^ ]+) Å; tomogram ([0-9]+) × ([0-9]+) × ([0-9]+) voxels");
  std::smatch found;
  TOMOFIELD_CHECK(std::regex_search(said, found, sizes), "a --dry-run without sizes: " + said);
  return {{std::stoll(found[2]), std::stoll(found[3]), std::stoll(found[4])}, std::stod(found[1])};
}

void require_one_grid(const NamedGrid& main, const NamedGrid& other) {
  constexpr double kRounding = 1e-3;  // of a plan's four digits
  if (main.grid.size == other.grid.size && !voxels_differ(other.grid, main.grid, kRounding)) return;
  throw Error(
      fmt::format("{} gives {} and {} gives {}: a comparison needs volumes of one size; give "
                  "--roi, --bin and --angpix to compare itself, and leave them and --axes out of "
                  "--also",
                  other.name, to_text(other.grid), main.name, to_text(main.grid)));
}

void require_truth_fits(const std::filesystem::path& truth, const NamedGrid& main, bool is_a_part) {
  constexpr double kLargestDifference = 0.05;
  const Grid grid = read_grid(truth);
  if (!voxels_differ(main.grid, grid, kLargestDifference) &&
      !has_axes_in_another_order(main.grid, grid) &&
      (is_a_part || !covers_less_than_half(main.grid, grid)))
    return;
  throw Error(
      fmt::format("the truth '{}' has {} and {} gives {}: give a truth of the same region, voxels "
                  "and axes, or change --roi, --thickness, --bin or --pixel-size",
                  truth.string(), to_text(grid), main.name, to_text(main.grid)));
}

}  // namespace tomofield::compare
