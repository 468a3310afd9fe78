#include "tomofield/evaluate.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/log.h"
#include "base/plausible.h"
#include "base/threads/parallel.h"
#include "evaluate/resolution/fsc.h"
#include "evaluate/similarity.h"
#include "tomofield/error.h"

namespace tomofield {
namespace {

base::Volume volume_of(const Tomogram& tomogram, const char* name) {
  const auto [nx, ny, nz] = tomogram.size;
  const base::CheckedSize voxels = base::CheckedSize(nx) * ny * nz;
  if (voxels.is(0) || !voxels.is(tomogram.values.size()))
    throw Error(fmt::format("the {} has {} values for {} × {} × {} voxels: give one a voxel", name,
                            tomogram.values.size(), nx, ny, nz));
  base::Volume volume;
  volume.shape = {nx, ny, nz};
  volume.voxel_size_A = tomogram.voxel_size_A;
  volume.data = tomogram.values;
  return volume;
}

// Warns of volumes that state two places (origin_A).
void warn_of_places(const Tomogram& first, const char* first_name, const Tomogram& second,
                    const char* second_name, double voxel_A) {
  constexpr double kSamePlace = 0.01;  // voxels
  if (!(voxel_A > 0)) return;
  std::array<double, 3> apart{};
  for (std::size_t a = 0; a < 3; ++a) apart[a] = (second.origin_A[a] - first.origin_A[a]) / voxel_A;
  if (std::ranges::all_of(apart, [](double voxels) { return std::abs(voxels) < kSamePlace; }))
    return;
  base::log_warning(
      fmt::format("the {} begins {:.4g}, {:.4g}, {:.4g} voxels after the {} (origin_A): compared "
                  "voxel by voxel all the same",
                  second_name, apart[0], apart[1], apart[2], first_name));
}

evaluate::VolumePair pair_of(const Tomogram& first, const char* first_name, const Tomogram& second,
                             const char* second_name) {
  evaluate::VolumePair pair{
      .first = volume_of(first, first_name), .second = volume_of(second, second_name), .box = {}};
  if (first.size != second.size)
    throw Error(
        fmt::format("the {} has {} × {} × {} voxels and the {} {} × {} × {}: cut both to one size",
                    first_name, first.size[0], first.size[1], first.size[2], second_name,
                    second.size[0], second.size[1], second.size[2]));
  const double voxel_A =
      evaluate::common_voxel_size_A(fmt::format("the {}", first_name), first.voxel_size_A,
                                    fmt::format("the {}", second_name), second.voxel_size_A);
  pair.first.voxel_size_A = pair.second.voxel_size_A = voxel_A;
  warn_of_places(first, first_name, second, second_name, voxel_A);
  return pair;
}

}  // namespace

VolumeScores score_volume(const Tomogram& volume, const Tomogram& truth) {
  const base::ThreadsInUse threads;
  const evaluate::Comparison score = evaluate::compare(pair_of(volume, "volume", truth, "truth"));
  return {.psnr_raw_dB = score.psnr.raw_dB,
          .psnr_affine_dB = score.psnr.affine_dB,
          .ssim_raw = score.ssim.raw,
          .ssim_affine = score.ssim.affine,
          .correlation = score.psnr.correlation,
          .scale = score.psnr.scale,
          .offset = score.psnr.offset,
          .peak = score.psnr.peak};
}

ShellCorrelation correlate_shells(const Tomogram& first, const Tomogram& second) {
  const base::ThreadsInUse threads;
  const auto pair = pair_of(first, "first volume", second, "second volume");
  if (!(pair.second.voxel_size_A > 0.0))
    throw Error(
        fmt::format("the volumes' voxel size of {} Å is not a positive number, so frequencies have "
                    "no scale",
                    pair.second.voxel_size_A));
  evaluate::Fsc fsc = evaluate::fourier_shell_correlation(
      pair.first, pair.second, evaluate::edge_window(pair.second.shape), std::nullopt);
  return {.frequency_per_A = std::move(fsc.frequency_per_A),
          .correlation = std::move(fsc.all.correlation),
          .voxels = std::move(fsc.all.voxels)};
}

std::optional<double> resolution_A(const ShellCorrelation& curve, double threshold) {
  return evaluate::crossing_A(
      curve.frequency_per_A, {.correlation = curve.correlation, .voxels = curve.voxels}, threshold);
}

}  // namespace tomofield
