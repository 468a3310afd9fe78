#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include "align/freedoms.h"
#include "base/progress.h"
#include "distributed/communicator.h"
#include "geometry/view_correction.h"
#include "measurement/measurement.h"
#include "tilt_series/tilt_series.h"
#include "tomofield/options.h"

namespace tomofield::alignment {

/// Describes a slab in the tilted views.
struct SlabPose {
  double thickness_px = 0.0;  ///< in pixels of the images
  double pitch_deg = 0.0;     ///< is added to all tilt angles: the slab lies level with them
};

/// The most likely pose, and the standard error of each of its numbers.
struct FoundPose {
  SlabPose pose, error;
};

/// Describes how well a view agrees with the projection of the field that it was registered to
/// last.
struct ViewAgreement {
  double correlation = 0.0;  ///< of both images, without trends
  /// Standard error of the shift in x and y, in pixels before binning.
  std::array<double, 2> error_px{};
  bool operator==(const ViewAgreement&) const = default;
};

/// The result of align_jointly(), and how well each view agrees with its prediction.
struct JointAlignment {
  std::vector<geometry::ViewCorrection> corrections;  ///< [view]
  std::vector<ViewAgreement> agreement;               ///< [view]
  Freedoms freedoms;  ///< those that made the prediction of pixels better
  /// Local motion that the last registration finds in each view, if that makes the prediction of
  /// pixels better; else empty.
  std::vector<geometry::ViewWarp> motion;
  /// Thickness and pitch of the specimen, in pixels before binning; none if the views do not tell.
  std::optional<FoundPose> pose;
  /// Root mean square of the change of the shifts in each update, in pixels before binning.
  std::vector<double> steps_px;
};

/// Describes the specimen and the field of a joint alignment.
struct JointProblem {
  const tilt_series::TiltSeries& recorded;  ///< views that are not resampled, and keep their pixels
  /// Everything of the measurement but its rays (measurement::plan_realigned).
  measurement::Measurement plan;
  FieldOptions field;  ///< its kind is replaced by plain vertices
  std::uint64_t seed = 1;
  const std::filesystem::path& scratch_dir;
  base::ProgressSink progress;
  std::function<bool()> stop_requested;  ///< is asked after each epoch; empty: never stop
};

/// Returns the options of the fit of align_jointly().
FitOptions joint_fit(std::uint64_t seed);

/// Number of epochs of the fit of coarse_residuals(): the first ones of joint_fit().
inline constexpr std::int64_t kResidualEpochs = 15;

/// Aligns the views of a series with the projections of a field while the field is being fitted to
/// them, from coarse to fine. After each epoch the field predicts all views. Each view is
/// registered to its prediction (registration.h) and resampled again from the recorded one. The
/// part that the views cannot tell is removed (gauge.h), and the fit goes on. `start` are the
/// corrections to begin with. Throws base::StopRequested if a stop was requested. Every process
/// calls it and gets the same.
JointAlignment align_jointly(const JointProblem& problem,
                             std::vector<geometry::ViewCorrection> start,
                             const distributed::Communicator& processes);

/// Does the same for the first epochs with coarse pixels alone, and returns what residual each view
/// has then: the mean square in the pixels that are not near an edge. Rotations are free whatever
/// `start` is, so that the residuals of different starts compare.
std::vector<double> coarse_residuals(const JointProblem& problem,
                                     const std::vector<geometry::ViewCorrection>& start,
                                     const distributed::Communicator& processes);

}  // namespace tomofield::alignment
