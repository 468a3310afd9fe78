#include "evaluate/compare.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "base/log.h"
#include "io/mrc.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

using Sizes = std::array<std::int64_t, 3>;

Sizes sizes_of(const io::MrcReader& file) {
  return {file.header().nx, file.header().ny, file.header().nz};
}

std::string to_text(const Sizes& sizes) {
  return fmt::format("{} × {} × {}", sizes[0], sizes[1], sizes[2]);
}

/// 0 and 1 Å are what programs write that do not know.
bool is_known(double voxel_size_A) { return voxel_size_A > 0.0 && voxel_size_A != 1.0; }

void check_voxel_sizes(const io::MrcReader& reconstruction, const io::MrcReader& truth) {
  const double a = reconstruction.header().voxel_size_A[0], b = truth.header().voxel_size_A[0];
  if (std::abs(a - b) <= 1e-4 * std::abs(b)) return;
  if (is_known(a) && is_known(b) && std::abs(a - b) > 0.05 * b)
    throw Error(fmt::format(
        "'{}' has voxels of {:.4g} Å and '{}' of {:.4g} Å: bring them to one voxel size first",
        reconstruction.path().string(), a, truth.path().string(), b));
  base::log_warning(
      fmt::format("the voxel sizes differ ({:.6g} Å and {:.6g} Å): compared voxel by "
                  "voxel all the same",
                  a, b));
}

void check_sizes(const io::MrcReader& reconstruction, const io::MrcReader& truth,
                 const Sizes& common) {
  const Sizes a = sizes_of(reconstruction), b = sizes_of(truth);
  if (a == b) return;
  Sizes sorted_a = a, sorted_b = b;
  std::sort(sorted_a.begin(), sorted_a.end());
  std::sort(sorted_b.begin(), sorted_b.end());
  const auto mismatch = [&](const char* advice) {
    return Error(fmt::format("'{}' has {} voxels and '{}' {}: {}", reconstruction.path().string(),
                             to_text(a), truth.path().string(), to_text(b), advice));
  };
  if (sorted_a == sorted_b)
    throw mismatch("the axes are in another order; write both volumes with the same --axes");
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (2 * common[axis] < b[axis])
      throw mismatch(
          "less than half of the truth is there; are they of the same specimen and scale?");
  }
  base::log_warning(
      fmt::format("'{}' has {} voxels and '{}' {}: the common centred box is compared",
                  reconstruction.path().string(), to_text(a), truth.path().string(), to_text(b)));
}

/// `box` if it lies in the common one (both in voxels of the truth).
Box restrict_box(const Box& box, const Box& common) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (box.first[axis] < common.first[axis] || box.last[axis] > common.last[axis] ||
        box.first[axis] >= box.last[axis])
      throw Error(fmt::format(
          "the box {},{},{} to {},{},{} must not be empty and must lie within {},{},{} to "
          "{},{},{}, what both volumes have, in voxels of the truth",
          box.first[0], box.first[1], box.first[2], box.last[0], box.last[1], box.last[2],
          common.first[0], common.first[1], common.first[2], common.last[0], common.last[1],
          common.last[2]));
  }
  return box;
}

base::Volume read_box(const io::MrcReader& file, const Box& box) {
  base::Volume volume(box.shape(), file.header().voxel_size_A[0]);
  const base::Shape3& shape = volume.shape;
  std::vector<float> rows(static_cast<std::size_t>(file.header().nx * shape.ny));
  for (std::int64_t z = 0; z < shape.nz; ++z) {
    file.read_rows(box.first[2] + z, box.first[1], shape.ny, rows);
    for (std::int64_t y = 0; y < shape.ny; ++y) {
      const auto from = rows.begin() + y * file.header().nx + box.first[0];
      std::copy(from, from + shape.nx, &volume.at(0, y, z));
    }
  }
  return volume;
}

}  // namespace

Comparison compare(const base::Volume& reconstruction, const base::Volume& truth) {
  Comparison comparison;
  const base::Shape3& shape = truth.shape;
  comparison.box.last = {shape.nx, shape.ny, shape.nz};
  comparison.psnr = psnr(reconstruction.data, truth.data);
  comparison.ssim = ssim(reconstruction, truth, comparison.psnr.peak, comparison.psnr.scale,
                         comparison.psnr.offset);
  return comparison;
}

Comparison compare_files(const std::filesystem::path& reconstruction,
                         const std::filesystem::path& truth, const std::optional<Box>& box) {
  const io::MrcReader a(reconstruction), b(truth);
  const Sizes size_a = sizes_of(a), size_b = sizes_of(b);
  Sizes common_sizes;
  Box common;  // in voxels of the truth
  for (std::size_t axis = 0; axis < 3; ++axis) {
    common_sizes[axis] = std::min(size_a[axis], size_b[axis]);
    common.first[axis] = (size_b[axis] - common_sizes[axis]) / 2;
    common.last[axis] = common.first[axis] + common_sizes[axis];
  }
  check_sizes(a, b, common_sizes);
  check_voxel_sizes(a, b);
  const Box in_truth = box ? restrict_box(*box, common) : common;
  Box in_reconstruction = in_truth;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int64_t shift = (size_a[axis] - common_sizes[axis]) / 2 - common.first[axis];
    in_reconstruction.first[axis] += shift;
    in_reconstruction.last[axis] += shift;
  }
  Comparison comparison = compare(read_box(a, in_reconstruction), read_box(b, in_truth));
  comparison.box = in_truth;
  return comparison;
}

nlohmann::json comparison_json(const Comparison& comparison,
                               const std::filesystem::path& reconstruction,
                               const std::filesystem::path& truth) {
  return {{"reconstruction", reconstruction.string()},
          {"truth", truth.string()},
          {"psnr_raw_dB", comparison.psnr.raw_dB},
          {"psnr_affine_dB", comparison.psnr.affine_dB},
          {"ssim_raw", comparison.ssim.raw},
          {"ssim_affine", comparison.ssim.affine},
          {"correlation", comparison.psnr.correlation},
          {"scale", comparison.psnr.scale},
          {"offset", comparison.psnr.offset},
          {"peak", comparison.psnr.peak},
          {"box_first", comparison.box.first},
          {"box_last", comparison.box.last}};
}

}  // namespace tomofield::evaluate
