#include "evaluate/sheet_filter.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/check.h"
#include "base/gaussian_kernel.h"
#include "base/system/memory.h"
#include "base/threads/parallel.h"
#include "base/utf8.h"
#include "io/images/mrc_format.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

constexpr double kSheetSigma_A = 20.0;

// Returns the index of a line of n values that goes on as its mirror image, in which the value at
// an edge is its own neighbour.
std::int64_t mirrored_about_edges(std::int64_t i, std::int64_t n) {
  while (i < 0 || i >= n) i = i < 0 ? -1 - i : 2 * n - 1 - i;
  return i;
}

// Blurs all lines along one axis, whose neighbours are `stride` apart.
void blur_axis(std::int64_t n, std::int64_t stride, std::span<const float> kernel,
               std::vector<float>& values) {
  const std::int64_t reach = std::ssize(kernel) / 2;
  const std::int64_t lines = std::ssize(values) / n;
  constexpr std::int64_t kLines = 256;
  base::parallel_for("blur", (lines + kLines - 1) / kLines, [&](std::int64_t task) {
    std::vector<float> line(static_cast<std::size_t>(n + 2 * reach));
    for (std::int64_t l = task * kLines; l < std::min(lines, (task + 1) * kLines); ++l) {
      float* first = values.data() + l / stride * stride * n + l % stride;
      for (std::int64_t i = -reach; i < n + reach; ++i)
        line[static_cast<std::size_t>(i + reach)] = first[mirrored_about_edges(i, n) * stride];
      for (std::int64_t i = 0; i < n; ++i) {
        float sum = 0.0f;
        for (std::size_t k = 0; k < kernel.size(); ++k)
          sum += kernel[k] * line[static_cast<std::size_t>(i) + k];
        first[i * stride] = sum;
      }
    }
  });
}

// The entries xx, yy, zz, xy, xz, yz of a symmetric matrix.
using Symmetric = std::array<double, 6>;

// Returns the eigenvalues from the smallest to the largest (Smith, Commun. ACM 4, 1961).
std::array<double, 3> eigenvalues(const Symmetric& m) {
  const double mean = (m[0] + m[1] + m[2]) / 3.0;
  const double a = m[0] - mean, b = m[1] - mean, c = m[2] - mean;
  const double off = m[3] * m[3] + m[4] * m[4] + m[5] * m[5];
  const double p = std::sqrt((a * a + b * b + c * c + 2.0 * off) / 6.0);
  if (p == 0.0) return {mean, mean, mean};
  const double determinant =
      a * (b * c - m[5] * m[5]) - m[3] * (m[3] * c - m[5] * m[4]) + m[4] * (m[3] * m[5] - b * m[4]);
  const double angle = std::acos(std::clamp(determinant / (2.0 * p * p * p), -1.0, 1.0)) / 3.0;
  const double largest = mean + 2.0 * p * std::cos(angle);
  const double smallest = mean + 2.0 * p * std::cos(angle + 2.0 * std::numbers::pi / 3.0);
  return {smallest, 3.0 * mean - largest - smallest, largest};
}

// Returns the Hessian matrix at a voxel, per voxel².
Symmetric hessian(const base::Volume& volume, std::int64_t x, std::int64_t y, std::int64_t z) {
  const base::Shape3& n = volume.shape;
  const auto at = [&](std::int64_t dx, std::int64_t dy, std::int64_t dz) {
    return static_cast<double>(volume.at(mirrored_about_edges(x + dx, n.nx),
                                         mirrored_about_edges(y + dy, n.ny),
                                         mirrored_about_edges(z + dz, n.nz)));
  };
  const double centre = 2.0 * at(0, 0, 0);
  const auto mixed = [&](double pp, double pm, double mp, double mm) {
    return (pp - pm - mp + mm) / 4.0;
  };
  return {at(1, 0, 0) + at(-1, 0, 0) - centre,
          at(0, 1, 0) + at(0, -1, 0) - centre,
          at(0, 0, 1) + at(0, 0, -1) - centre,
          mixed(at(1, 1, 0), at(1, -1, 0), at(-1, 1, 0), at(-1, -1, 0)),
          mixed(at(1, 0, 1), at(1, 0, -1), at(-1, 0, 1), at(-1, 0, -1)),
          mixed(at(0, 1, 1), at(0, 1, -1), at(0, -1, 1), at(0, -1, -1))};
}

}  // namespace

base::Volume sheet_response(const base::Volume& volume, double sigma_px) {
  const base::Shape3& shape = volume.shape;
  if (std::min({shape.nx, shape.ny, shape.nz}) < 3)
    throw Error("a volume needs 3 voxels along each axis to look for sheets in it");
  base::Volume blurred = volume;
  constexpr double kDeviations = 4.0;
  const std::vector<float> kernel = base::gaussian_kernel(sigma_px, kDeviations);
  blur_axis(shape.nx, 1, kernel, blurred.data);
  blur_axis(shape.ny, shape.nx, kernel, blurred.data);
  blur_axis(shape.nz, shape.nx * shape.ny, kernel, blurred.data);
  base::Volume response(shape, volume.voxel_size_A);
  base::parallel_for("find sheets", shape.nz, [&](std::int64_t z) {
    for (std::int64_t y = 0; y < shape.ny; ++y)
      for (std::int64_t x = 0; x < shape.nx; ++x) {
        const auto lambda = eigenvalues(hessian(blurred, x, y, z));
        response.at(x, y, z) = static_cast<float>(std::max(0.0, -lambda[0] - std::abs(lambda[1])));
      }
  });
  return response;
}

DetectionScore membrane_score(const base::Volume& volume, const base::Volume& label) {
  TOMOFIELD_CHECK(volume.shape == label.shape, "the label has another shape than the volume");
  if (!io::is_known_size(label.voxel_size_A))
    throw Error("the label of membranes has no voxel size, which the filter for sheets needs");
  const auto num_bad =
      std::ranges::count_if(label.data, [](float value) { return !std::isfinite(value); });
  if (num_bad > 0) {
    throw Error(
        fmt::format("the label of membranes has {} voxels that are no finite numbers: write "
                    "1 where there is membrane and 0 elsewhere",
                    num_bad));
  }
  // The blurred volume, the response, and both once more with the label, which are sorted.
  constexpr std::size_t kBytesOfVoxel = 2 * sizeof(float) + sizeof(Detection);
  base::require_memory(kBytesOfVoxel * label.shape.voxels(), "the filter for sheets",
                       "bin both volumes, or cut a part out of both");
  const double sigma_px = kSheetSigma_A / label.voxel_size_A;
  const auto longest_px =
      static_cast<double>(std::max({label.shape.nx, label.shape.ny, label.shape.nz}));
  if (sigma_px > longest_px)
    throw Error(
        fmt::format("the filter for sheets blurs by {:g} Å, and all of the volume has {:.3g} Å by "
                    "its voxels of {:g} Å: correct its header",
                    kSheetSigma_A, longest_px * label.voxel_size_A, label.voxel_size_A));
  const base::Volume response = sheet_response(volume, sigma_px);
  std::vector<Detection> voxels(response.data.size());
  std::size_t num_true = 0;
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    voxels[i] = {response.data[i], label.data[i] > 0.5f};
    num_true += voxels[i].is_true ? 1 : 0;
  }
  if (num_true == 0) throw Error("the label of membranes has no voxel above 0.5: nothing to find");
  if (num_true == voxels.size())
    throw Error("the label of membranes has all voxels above 0.5: there is nothing else to tell");
  return score_detections(std::move(voxels), num_true);
}

}  // namespace tomofield::evaluate
