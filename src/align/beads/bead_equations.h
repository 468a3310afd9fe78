#pragma once

#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "align/beads/bead_alignment.h"
#include "geometry/view_correction.h"

namespace tomofield::alignment {

/// An unknown: the coefficient of a mode, which is a function of the view, in a quantity that may
/// change.
struct BeadUnknown {
  enum Quantity { kX, kY, kRotation, kMagnification, kQuantities };
  Quantity quantity;
  Eigen::Index mode;
};

/// The spots of a bead as a least-squares problem: the distances in x of all spots from where the
/// bead should be, then those in y, with Huber's weights (1964). The place of the bead is found
/// along with what else is unknown. `modes` are [view, mode], and steps [view].
class BeadEquations {
 public:
  /// The spots must outlive the equations.
  BeadEquations(const std::vector<BeadPoint>& spots, const BeadGeometry& geometry);

  /// Returns the distances from the bead at its best place, after steps.
  Eigen::VectorXd distances(std::span<const geometry::ViewCorrection> steps) const;

  /// Lets all distances count alike, as at first.
  void weigh_equally() { weights_.setOnes(); }
  /// Lets distances beyond three standard deviations count less.
  void weigh(const Eigen::VectorXd& distances, double deviation);

  /// Returns the mean squared distance with these weights.
  double mean_square(const Eigen::VectorXd& distances) const;

  /// Adds the normal equations for the unknowns of the next step.
  void add_to(const std::vector<BeadUnknown>& unknowns, const Eigen::MatrixXd& modes,
              std::span<const geometry::ViewCorrection> steps, Eigen::MatrixXd& normal,
              Eigen::VectorXd& right) const;

  /// Returns the square of the part of the distances that the modes explain beyond the place of
  /// the bead, and its number of dimensions.
  std::pair<double, double> slow_part(const Eigen::MatrixXd& modes,
                                      std::span<const geometry::ViewCorrection> steps) const;

 private:
  Eigen::MatrixXd beyond_place(const Eigen::MatrixXd& columns) const;
  Eigen::Vector3d best_place(const Eigen::VectorXd& measured) const;
  Eigen::MatrixXd by_unknowns(const std::vector<BeadUnknown>& unknowns,
                              const Eigen::MatrixXd& modes,
                              std::span<const geometry::ViewCorrection> steps) const;

  const std::vector<BeadPoint>& spots_;
  double axis_px_;
  Eigen::MatrixX3d place_;   // derivatives by X, Z and Y
  Eigen::VectorXd weights_;  // of the squared distances
};

}  // namespace tomofield::alignment
