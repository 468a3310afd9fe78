#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "align/beads/bead_alignment.h"
#include "align/joint_alignment.h"
#include "align/trial.h"
#include "distributed/communicator.h"
#include "geometry/view_correction.h"
#include "measurement/measurement.h"

namespace tomofield::alignment {

/// An alignment is judged by views that it holds out, so it needs some.
constexpr std::size_t kFewestViews = 12;
/// Throws Error if there are fewer.
void require_views(std::size_t num_views);

/// The local motion of a series, and whether held-out views are predicted better with it.
struct LocalTrial {
  Comparison held_out;
  std::vector<double> steps_px;  ///< LocalAlignment::steps_px
  bool is_accepted = false;
};

/// The alignment of a series, and whether held-out views are predicted better with it.
struct Alignment {
  std::vector<geometry::ViewCorrection> corrections;  ///< [view]; none if it was not accepted
  JointAlignment joint;
  Comparison held_out;  ///< with the alignment that the files give and with the new one
  bool is_accepted = false;
  std::optional<BeadAlignment> beads;  ///< none if there are no gold beads
  std::optional<LocalTrial> local;     ///< none if the views show no local motion
  std::vector<int> unaligned;          ///< views that do not resemble their projections, ascending
};

/// Fits of an alignment: the first epochs of a fit, several times.
struct PlannedFits {
  FitOptions options;
  std::int64_t epochs;
  int times;
  /// Time of resampling and registering a view in all updates of a fit, most of which have wide
  /// pixels, over seconds_of_update(). It was measured on phantoms of 128 and 256 pixels.
  double updates;
};

/// Returns the field of the fits of an alignment, for a field that the reconstruction asks for.
FieldOptions planned_field(const FieldOptions& field);
/// Returns the fits that an alignment makes, without that for local motion. `from_raw`: with the
/// search for the tilt axis.
std::vector<PlannedFits> planned_fits(const measurement::Measurement& plan, bool from_raw,
                                      std::uint64_t seed);

/// Resamples an aligned view of this width and registers it once. Returns the processor time.
double seconds_of_update(std::span<const float> image, std::int64_t width);

/// Returns the bytes that an alignment takes beside a fit.
std::size_t memory_beside_fit(const measurement::Measurement& plan);

/// Finds shifts of a few pixels' accuracy by cross-correlation of small images of the views
/// (correlation_start.h), for a series that is not aligned but for the direction of its tilt axis.
std::vector<geometry::ViewCorrection> correlated_start(const JointProblem& problem);

/// Aligns a series further, from `start`: with a field (joint_alignment.h), and then with gold
/// beads if there are some that tell more (bead_alignment.h). Without them, the direction of the
/// tilt axis is made finer (with_refined_axis()). The new alignment is accepted if a field that is
/// fitted with it predicts held-out views better, by more than two standard errors over the
/// views. If the views then show local motion (JointAlignment::motion), it is looked for, and it is
/// accepted in the same way. Throws base::StopRequested if a stop was requested. Every process
/// calls it and gets the same.
Alignment refine_alignment(const JointProblem& problem, std::vector<geometry::ViewCorrection> start,
                           const distributed::Communicator& processes);

}  // namespace tomofield::alignment
