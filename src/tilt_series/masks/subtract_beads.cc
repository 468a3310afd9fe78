#include "tilt_series/masks/subtract_beads.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "tilt_series/masks/bead_fringes.h"

namespace tomofield::tilt_series {
namespace {

// Pixels within this distance of the middle of a bead do not decide about it.
constexpr double kCore_radii = 1.1, kCore_px = 1.0;

// The mask of a bead whose fringes were subtracted has a radius of 1.05 of its diameters.
constexpr double kMaskWithoutFringes = 1.05;

// Standard deviations by which beads are believed to differ: their densities as a part of the mean,
// their radii as a part of the given one, and their places from those that were found.
constexpr double kSpreadOfDensity = 0.3, kSpreadOfRadius = 0.1, kSpreadOfPlace_px = 0.5;
constexpr double kMostStepOfRadius = 0.15, kMostMove_px = 0.7;

constexpr int kRoundsOfShape = 3;    // of radii and places
constexpr int kRoundsOfDensity = 2;  // of beads whose fringes overlap, in turn

// Columns of the least-squares problem; those after the fringes are their derivatives.
enum FringeColumn { kFringes, kByPlaceX, kByPlaceY, kByRadius, kConstant, kFringeColumns };
using FringeRow = Eigen::Matrix<double, kFringeColumns, 1>;

// The normal equations of the pixels beside a bead.
struct BeadEquations {
  Eigen::Matrix<double, kFringeColumns, kFringeColumns> normal =
      Eigen::Matrix<double, kFringeColumns, kFringeColumns>::Zero();
  FringeRow right = FringeRow::Zero();
  double squares = 0.0;

  void add(const FringeRow& row, double value) {
    normal += row * row.transpose();
    right += value * row;
    squares += value * value;
  }
};

struct FittedBead {
  BeadFringes fringes;
  double density = 0.0;
  double noise = 0.0;        // variance of a pixel; 0: too few pixels tell the density
  double information = 0.0;  // of the density, over the variance of a pixel

  bool is_told() const { return noise > 0.0; }
};

// Marks the pixels that may tell of beads: measurements outside of all of them.
std::vector<std::uint8_t> pixels_beside(std::span<const FittedBead> beads,
                                        const MaskedImage& image) {
  std::vector<std::uint8_t> beside = image.valid;
  for (const FittedBead& bead : beads) {
    const Sphere& sphere = bead.fringes.sphere;
    for_pixels_in({sphere.x_px, sphere.y_px, kCore_radii * sphere.radius_px + kCore_px},
                  image.width, image.height,
                  [&](std::int64_t x, std::int64_t y) { beside[image.index(x, y)] = 0; });
  }
  return beside;
}

// Returns the equations of a bead. `rest` is the view without all beads as they are fitted.
BeadEquations equations_of(const FittedBead& bead, const MaskedImage& rest,
                           const std::vector<std::uint8_t>& beside) {
  BeadEquations equations;
  const BeadFringes& fringes = bead.fringes;
  fringes.for_pixels(rest, [&](std::size_t at, std::size_t i, std::int64_t x, std::int64_t y) {
    if (!beside[at] || fringes.sphere.distance(x, y) > fringes.outer_px) return;
    FringeRow row;
    row << double(fringes.values[i]), double(fringes.by_x[i]), double(fringes.by_y[i]),
        double(fringes.by_radius[i]), 1.0;
    equations.add(row, double(rest.values[at]) + bead.density * row[kFringes]);
  });
  return equations;
}

void set_density(double density, FittedBead& bead, MaskedImage& rest) {
  const auto change = static_cast<float>(density - bead.density);
  bead.density = density;
  bead.fringes.for_pixels(rest, [&](std::size_t at, std::size_t i, std::int64_t, std::int64_t) {
    rest.values[at] -= change * bead.fringes.values[i];
  });
}

// Fits the density of a bead and a constant.
void fit_density(const std::vector<std::uint8_t>& beside, FittedBead& bead, MaskedImage& rest) {
  const BeadEquations e = equations_of(bead, rest, beside);
  const double n = e.normal(kConstant, kConstant), t = e.normal(kFringes, kConstant);
  bead.noise = bead.information = 0.0;
  if (n <= double(kFringeColumns)) return;
  bead.information = e.normal(kFringes, kFringes) - t * t / n;
  if (!(bead.information > 0.0)) return;
  const double product = e.right[kFringes] - t * e.right[kConstant] / n;
  const double squares = e.squares - e.right[kConstant] * e.right[kConstant] / n;
  bead.noise = std::max(squares - product * product / bead.information, 0.0) / (n - 2);
  set_density(product / bead.information, bead, rest);
}

// Returns the mean density, weighted by what the view tells of each.
double mean_density(std::span<const FittedBead> beads) {
  double sum = 0.0, weights = 0.0;
  for (const FittedBead& bead : beads) {
    if (!bead.is_told()) continue;
    const double weight = bead.information / bead.noise;
    sum += weight * bead.density;
    weights += weight;
  }
  return weights > 0.0 ? sum / weights : 0.0;
}

// Returns where a bead is and how large it is, by its pixels and by what is believed before.
Sphere refined(const FittedBead& bead, const MaskedImage& rest,
               const std::vector<std::uint8_t>& beside, double mean) {
  BeadEquations e = equations_of(bead, rest, beside);
  const auto believe = [&](FringeColumn column, double value, double spread) {
    const double weight = bead.noise / (spread * spread * mean * mean);
    e.normal(column, column) += weight;
    e.right[column] += weight * value;
  };
  believe(kFringes, mean, kSpreadOfDensity);
  believe(kByPlaceX, 0.0, kSpreadOfPlace_px);
  believe(kByPlaceY, 0.0, kSpreadOfPlace_px);
  believe(kByRadius, 0.0, kSpreadOfRadius);
  const FringeRow found = e.normal.ldlt().solve(e.right);
  Sphere sphere = bead.fringes.sphere;
  if (!(found[kFringes] > kSpreadOfDensity * mean)) return sphere;
  const auto step = [&](FringeColumn column, double most) {
    return std::clamp(found[column] / found[kFringes], -most, most);
  };
  sphere.x_px += step(kByPlaceX, kMostMove_px);
  sphere.y_px += step(kByPlaceY, kMostMove_px);
  sphere.radius_px *= 1.0 + step(kByRadius, kMostStepOfRadius);
  return sphere;
}

// Holds the fit of all beads of a view.
class BeadFit {
 public:
  BeadFit(std::span<const MaskDisc> discs, double radius_px,
          const microscope::ViewTransfer& transfer, const MaskedImage& view)
      : transfer_(transfer), view_(view), beads_(discs.size()) {
    std::vector<Sphere> spheres;
    for (const MaskDisc& disc : discs) spheres.push_back({disc.x_px, disc.y_px, radius_px});
    begin(spheres);
  }

  // Returns the beads, or none if their mean density is not positive.
  std::vector<FittedBead> solve() {
    for (int round = 0;; ++round) {
      for (int turn = 0; turn < kRoundsOfDensity; ++turn)
        for (FittedBead& bead : beads_) fit_density(beside_, bead, rest_);
      const double mean = mean_density(beads_);
      if (!(mean > 0.0)) return {};
      draw_to(mean);
      if (round == kRoundsOfShape) return beads_;
      begin(refined_spheres(mean));
    }
  }

 private:
  void begin(std::span<const Sphere> spheres) {
    for (std::size_t i = 0; i < beads_.size(); ++i)
      beads_[i] = {.fringes = fringes_of(spheres[i], transfer_, view_.width, view_.height)};
    beside_ = pixels_beside(beads_, view_);
    rest_ = view_;
  }

  std::vector<Sphere> refined_spheres(double mean) const {
    std::vector<Sphere> spheres;
    for (const FittedBead& bead : beads_) {
      spheres.push_back(bead.is_told() ? refined(bead, rest_, beside_, mean) : bead.fringes.sphere);
    }
    return spheres;
  }

  void draw_to(double mean) {
    const double prior = 1.0 / (kSpreadOfDensity * kSpreadOfDensity * mean * mean);
    for (FittedBead& bead : beads_) {
      const double told = bead.is_told() ? bead.information / bead.noise : 0.0;
      const double drawn = (bead.density * told + mean * prior) / (told + prior);
      set_density(std::max(drawn, 0.0), bead, rest_);
    }
  }

  const microscope::ViewTransfer& transfer_;
  const MaskedImage& view_;
  std::vector<FittedBead> beads_;
  std::vector<std::uint8_t> beside_;
  MaskedImage rest_;
};

}  // namespace

std::vector<MaskDisc> subtract_beads(const std::vector<MaskDisc>& discs, double diameter_px,
                                     const microscope::ViewTransfer& transfer, MaskedImage* image) {
  const std::vector<FittedBead> beads = BeadFit(discs, diameter_px / 2, transfer, *image).solve();
  if (beads.empty()) return discs;
  std::vector<MaskDisc> left;
  for (const FittedBead& bead : beads) {
    bead.fringes.for_pixels(*image, [&](std::size_t at, std::size_t i, std::int64_t, std::int64_t) {
      if (!image->valid[at]) return;
      image->values[at] -= static_cast<float>(bead.density) * bead.fringes.values[i];
    });
    const Sphere& sphere = bead.fringes.sphere;
    left.push_back({sphere.x_px, sphere.y_px, 2 * kMaskWithoutFringes * sphere.radius_px});
  }
  return left;
}

}  // namespace tomofield::tilt_series
