#include "align/beads/bead_alignment.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "align/beads/bead_equations.h"
#include "base/statistics.h"
#include "base/trace.h"
#include "geometry/tilt_geometry.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::alignment {
namespace {

using geometry::ViewCorrection;

constexpr std::size_t kFewestBeads = 3;
constexpr std::size_t kFewestSpots = 4;  // of a bead that counts
constexpr int kModes = 6;                // cosines over the views, from the constant one on
constexpr int kRounds = 8;               // of least squares
// Largest number of turns in which beads are left out, to see whether the others predict them.
constexpr std::size_t kMostTurns = 8;
constexpr double kSure = 1.0;  // standard errors by which the steps must pay

constexpr double kDegree = std::numbers::pi / 180.0;
// A joint alignment leaves errors of these sizes on phantoms: standard deviations of a coefficient
// of each quantity, in pixels of the fit and radians (docs/results/alignment.md). It sees the
// direction of the tilt axis least of all.
constexpr double kLeft[BeadUnknown::kQuantities] = {0.05, 0.03, 0.05 * kDegree, 5e-4};
constexpr double kLeftOfAxis = 0.15 * kDegree;

double expected(const BeadUnknown& unknown) {
  const bool is_axis = unknown.quantity == BeadUnknown::kRotation && unknown.mode == 0;
  return is_axis ? kLeftOfAxis : kLeft[unknown.quantity];
}

std::vector<BeadUnknown> unknowns_of(const Freedoms& freedoms) {
  std::vector<BeadUnknown> unknowns;
  for (const BeadUnknown::Quantity quantity :
       {BeadUnknown::kX, BeadUnknown::kY, BeadUnknown::kRotation, BeadUnknown::kMagnification})
    for (Eigen::Index mode = 0; mode < kModes; ++mode)
      if (quantity != BeadUnknown::kMagnification || freedoms.magnification)
        unknowns.push_back({quantity, mode});
  return unknowns;
}

// Returns the values [view, mode] of the cosines.
Eigen::MatrixXd cosines(std::span<const double> tilt_deg) {
  const std::vector<std::size_t> by_tilt = geometry::order_of_tilts(tilt_deg);
  const auto n = std::ssize(tilt_deg);
  Eigen::MatrixXd values(n, kModes);
  for (Eigen::Index rank = 0; rank < n; ++rank)
    for (Eigen::Index mode = 0; mode < values.cols(); ++mode)
      values(static_cast<Eigen::Index>(by_tilt[static_cast<std::size_t>(rank)]), mode) =
          std::cos(std::numbers::pi * static_cast<double>(mode) *
                   (static_cast<double>(rank) + 0.5) / static_cast<double>(n));
  return values;
}

// The spots of several beads and the steps that fit them.
class BeadSet {
 public:
  BeadSet(std::span<const std::vector<BeadPoint>> beads, const BeadGeometry& geometry,
          const Freedoms& freedoms)
      : modes_(cosines(geometry.tilt_deg)), unknowns_(unknowns_of(freedoms)) {
    for (const std::vector<BeadPoint>& spots : beads) beads_.emplace_back(spots, geometry);
  }

  // Returns the steps after which the beads agree best with their places.
  std::vector<ViewCorrection> fit() {
    std::vector<ViewCorrection> steps(static_cast<std::size_t>(modes_.rows()));
    Eigen::VectorXd values = Eigen::VectorXd::Zero(std::ssize(unknowns_));  // in all steps
    for (int round = 0; round < kRounds; ++round) {
      weigh(steps);
      const double variance = slow_variance(steps);
      if (!(variance > 0.0)) break;
      const auto n = std::ssize(unknowns_);
      Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(n, n);
      Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
      for (const BeadEquations& bead : beads_) bead.add_to(unknowns_, modes_, steps, normal, right);
      for (Eigen::Index i = 0; i < n; ++i) {
        const double ridge =
            variance / std::pow(expected(unknowns_[static_cast<std::size_t>(i)]), 2);
        normal(i, i) += ridge;
        right[i] -= ridge * values[i];
      }
      const Eigen::VectorXd change = normal.ldlt().solve(right);
      take_step(change, steps);
      values += change;
    }
    return steps;
  }

  // Renews the weights of the distances, by their median size. The places of the beads depend on
  // the weights.
  void weigh(std::span<const ViewCorrection> steps) {
    constexpr int kTurns = 3;
    for (BeadEquations& bead : beads_) bead.weigh_equally();
    for (int turn = 0; turn < kTurns; ++turn) {
      const double deviation = standard_deviation(steps);
      for (BeadEquations& bead : beads_) bead.weigh(bead.distances(steps), deviation);
    }
  }

  // Returns the mean squared distance of each bead after steps.
  std::vector<double> mean_squares(std::span<const ViewCorrection> steps) const {
    std::vector<double> squares;
    for (const BeadEquations& bead : beads_)
      squares.push_back(bead.mean_square(bead.distances(steps)));
    return squares;
  }

  // Returns the root mean square of the distances after steps, which decide about the weights.
  double root_mean_square(std::span<const ViewCorrection> steps) {
    weigh(steps);
    const std::vector<double> squares = mean_squares(steps);
    return std::sqrt(std::accumulate(squares.begin(), squares.end(), 0.0) /
                     static_cast<double>(squares.size()));
  }

 private:
  // Returns the standard deviation of all distances, by their median size.
  double standard_deviation(std::span<const ViewCorrection> steps) const {
    std::vector<double> sizes;
    for (const BeadEquations& bead : beads_)
      for (const double distance : bead.distances(steps)) sizes.push_back(std::abs(distance));
    return base::kSigmaOfMedianDeviation * base::median_in_place(sizes);
  }

  // Returns the variance of the part of the distances that changes slowly over the tilts. It is
  // larger than that of the rest, because what lies above and below a bead moves its spots, and
  // changes slowly.
  double slow_variance(std::span<const ViewCorrection> steps) const {
    double squares = 0.0, count = 0.0;
    for (const BeadEquations& bead : beads_) {
      const auto [of_bead, rank] = bead.slow_part(modes_, steps);
      squares += of_bead;
      count += rank;
    }
    return squares / std::max(count, 1.0);
  }

  void take_step(const Eigen::VectorXd& values, std::vector<ViewCorrection>& steps) const {
    for (std::size_t view = 0; view < steps.size(); ++view) {
      double changes[BeadUnknown::kQuantities] = {};
      for (Eigen::Index i = 0; i < values.size(); ++i) {
        const auto [quantity, mode] = unknowns_[static_cast<std::size_t>(i)];
        changes[quantity] += values[i] * modes_(static_cast<Eigen::Index>(view), mode);
      }
      steps[view] = steps[view].then({.shift_x_px = changes[BeadUnknown::kX],
                                      .shift_y_px = changes[BeadUnknown::kY],
                                      .rotation_rad = changes[BeadUnknown::kRotation],
                                      .log_magnification = changes[BeadUnknown::kMagnification]});
    }
  }

  Eigen::MatrixXd modes_;
  std::vector<BeadUnknown> unknowns_;
  std::vector<BeadEquations> beads_;
};

// Returns by which part the squared distances of each bead fall if the others decide.
base::MeanGain gain_of_others(std::span<const std::vector<BeadPoint>> beads,
                              const BeadGeometry& geometry, const Freedoms& freedoms) {
  const std::size_t turns = std::min(beads.size(), kMostTurns);
  const std::vector<ViewCorrection> none(geometry.tilt_deg.size());
  std::vector<double> gains;
  for (std::size_t turn = 0; turn < turns; ++turn) {
    std::vector<std::vector<BeadPoint>> deciding, judging;
    for (std::size_t i = 0; i < beads.size(); ++i)
      (i % turns == turn ? judging : deciding).push_back(beads[i]);
    const std::vector<ViewCorrection> steps = BeadSet(deciding, geometry, freedoms).fit();
    BeadSet judges(judging, geometry, freedoms);
    judges.weigh(none);
    const std::vector<double> before = judges.mean_squares(none),
                              after = judges.mean_squares(steps);
    for (std::size_t i = 0; i < before.size(); ++i)
      if (before[i] > 0.0) gains.push_back(1.0 - after[i] / before[i]);
  }
  return base::mean_gain(gains);
}

// Returns where the spots are in views that are not corrected.
std::vector<std::vector<BeadPoint>> uncorrected(std::span<const std::vector<BeadPoint>> beads,
                                                std::span<const ViewCorrection> corrections) {
  std::vector<std::vector<BeadPoint>> moved_back(beads.begin(), beads.end());
  for (std::vector<BeadPoint>& spots : moved_back) {
    for (BeadPoint& spot : spots) {
      const ViewCorrection at =
          corrections[spot.view].then({.shift_x_px = spot.x_px, .shift_y_px = spot.y_px});
      spot = {spot.view, at.shift_x_px, at.shift_y_px};
    }
  }
  return moved_back;
}

std::vector<ViewCorrection> binned(std::vector<ViewCorrection> corrections, double factor) {
  for (ViewCorrection& correction : corrections) correction = correction.binned(factor);
  return corrections;
}

// Returns the distance of the spots from their places with the alignment of the files.
double distance_in_files(std::span<const std::vector<BeadPoint>> beads,
                         std::span<const ViewCorrection> corrections, BeadGeometry geometry,
                         const Freedoms& freedoms) {
  for (std::size_t view = 0; view < corrections.size(); ++view)
    geometry.tilt_deg[view] -= corrections[view].tilt_deg;
  const auto in_files = uncorrected(beads, corrections);
  return BeadSet(in_files, geometry, freedoms)
      .root_mean_square(std::vector<ViewCorrection>(corrections.size()));
}

}  // namespace

std::optional<BeadAlignment> fit_beads(std::span<const std::vector<BeadPoint>> beads,
                                       std::span<const ViewCorrection> corrections,
                                       const BeadGeometry& geometry, const Freedoms& freedoms) {
  if (beads.size() < kFewestBeads) return std::nullopt;
  BeadSet all(beads, geometry, freedoms);
  const std::vector<ViewCorrection> none(corrections.size());
  BeadAlignment found;
  found.steps = all.fit();
  found.num_beads = beads.size();
  found.files_px = distance_in_files(beads, corrections, geometry, freedoms);
  found.before_px = all.root_mean_square(none);
  found.after_px = all.root_mean_square(found.steps);
  found.gain = gain_of_others(beads, geometry, freedoms);
  found.is_accepted = found.gain.exceeds(kSure);
  return found;
}

std::optional<BeadAlignment> align_by_beads(const JointProblem& problem,
                                            const std::vector<ViewCorrection>& corrections,
                                            const Freedoms& freedoms,
                                            const distributed::Communicator& processes) {
  const base::TraceSpan span("align by beads");
  const tilt_series::TiltSeries& series = problem.recorded;
  const double centre_x = static_cast<double>(series.aligned_width()) / 2,
               centre_y = static_cast<double>(series.aligned_height()) / 2;
  BeadGeometry geometry;
  geometry.axis_px = problem.plan.geometry.axis_x - centre_x;
  for (std::size_t view = 0; view < corrections.size(); ++view)
    geometry.tilt_deg.push_back(series.views()[view].tilt_deg + corrections[view].tilt_deg);
  std::vector<std::vector<BeadPoint>> beads;
  for (const auto& spots :
       series.find_bead_spots(corrections, problem.plan.geometry.axis_x, processes)) {
    if (spots.size() < kFewestSpots) continue;
    beads.emplace_back();
    for (const tilt_series::BeadSpot& spot : spots)
      beads.back().push_back({spot.view, spot.x_px - centre_x, spot.y_px - centre_y});
  }
  const double bin = series.bin_factor();
  auto found = fit_beads(beads, binned(corrections, bin), geometry, freedoms);
  if (!found) return found;
  found->steps = binned(found->steps, 1 / bin);
  for (double* distance : {&found->files_px, &found->before_px, &found->after_px}) *distance *= bin;
  return found;
}

}  // namespace tomofield::alignment
