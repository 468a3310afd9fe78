#include "align/local/local_alignment.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "align/aligning_fit.h"
#include "align/gauge.h"
#include "align/local/local_registration.h"
#include "align/local/slow_modes.h"
#include "align/relaxation.h"
#include "base/trace.h"
#include "fit/fit.h"
#include "fit/stages.h"
#include "geometry/tilt_geometry.h"

namespace tomofield::alignment {
namespace {

using geometry::ViewCorrection;
using geometry::ViewWarp;

// With wider pixels the field shows too little to find motion in it.
constexpr int kCoarsestBin = 2;
constexpr int kCoarseEpochs = 40, kFineEpochs = 8;
constexpr std::size_t kComponents = 2 * ViewWarp::kNodes * ViewWarp::kNodes;

double& component(ViewWarp& motion, std::size_t i) { return motion.nodes[i / 2][i % 2]; }

// Returns a correction of a view that shows `motion` where the rest of the correction is undone.
// The rigid part of the motion becomes a part of the rest, as far as that is free.
ViewCorrection with_motion(ViewCorrection correction, const ViewWarp& motion,
                           const Freedoms& freedoms) {
  const ViewWarp::Rigid rigid = motion.rigid_part();
  correction.local.reset();
  // The view shows at q what belongs at q + d(q), so it is to be moved by −d.
  return correction.then({.shift_x_px = -rigid.shift[0],
                          .shift_y_px = -rigid.shift[1],
                          .rotation_rad = freedoms.rotation ? -rigid.rotation : 0.0,
                          .log_magnification = freedoms.magnification ? -rigid.magnification : 0.0,
                          .local = motion.without(rigid)});
}

FitOptions local_fit(std::uint64_t seed) { return aligning_fit(kCoarseEpochs, kFineEpochs, seed); }

double rms_change(const std::vector<ViewCorrection>& from, const std::vector<ViewCorrection>& to) {
  double squares = 0.0;
  for (std::size_t v = 0; v < from.size(); ++v) {
    ViewWarp change = *to[v].local, before = *from[v].local;
    for (std::size_t i = 0; i < kComponents; ++i) component(change, i) -= component(before, i);
    squares += change.mean_square();
  }
  return std::sqrt(squares / static_cast<double>(from.size()));
}

// A fit and the corrections of the views that it is made with.
class LocalFit {
 public:
  LocalFit(const JointProblem& problem, const Freedoms& freedoms, std::vector<ViewCorrection> start,
           const distributed::Communicator& processes)
      : problem_(problem),
        freedoms_(freedoms),
        processes_(processes),
        field_(aligning_field(problem.field)),
        measurement_(aligning_measurement(
            problem, start, fit::make_stages(field_, local_fit(problem.seed)).front().bin, field_,
            processes)),
        fit_(measurement_, field_, local_fit(problem.seed), processes),
        by_tilt_(geometry::order_of_tilts(measurement_.geometry.tilt_deg)) {
    found_.agreement.resize(start.size());
    found_.corrections = std::move(start);
  }

  LocalAlignment run() {
    const FitInProgress in_progress{problem_,        field_,       found_.corrections,
                                    found_.steps_px, measurement_, fit_};
    run_with_updates(
        in_progress, fit_.num_epochs(), [this](const fit::Stage& stage) { return update(stage); },
        processes_);
    return std::move(found_);
  }

 private:
  // Registers every view where the field shows enough.
  bool update(const fit::Stage& stage) {
    if (stage.bin > kCoarsestBin) return false;
    const base::TraceSpan span("register local motion");
    const std::vector<ViewWarp> steps = amplified(register_views(stage));
    std::vector<ViewCorrection> next = found_.corrections;
    for (std::size_t v = 0; v < next.size(); ++v)
      next[v] = with_motion(next[v], next[v].local->then(steps[v]), freedoms_);
    remove_gauge(measurement_.geometry, next);
    found_.steps_px.push_back(rms_change(found_.corrections, next));
    found_.corrections = std::move(next);
    return true;
  }

  // Returns the motion that each view shows beside what is undone already.
  std::vector<ViewWarp> register_views(const fit::Stage& stage) {
    std::vector<ViewWarp> motion(found_.corrections.size());
    const LocalRegistrationOptions options = local_options(measurement_, stage);
    for_each_prediction(fit_, measurement_, stage, [&](std::size_t view, const ImagePair& images) {
      LocalRegistration local(options);
      const Registration whole(images, {}, &local);
      motion[view] = local.solve(*found_.corrections[view].local);
      found_.agreement[view] = {whole.correlation(), whole.shift_error(freedoms_)};
    });
    return motion;
  }

  // Returns the steps that are taken for the motion that the registrations found.
  std::vector<ViewWarp> amplified(std::vector<ViewWarp> motion) {
    std::vector<double> found;
    for (ViewWarp& of_view : motion)
      for (std::size_t i = 0; i < kComponents; ++i) found.push_back(component(of_view, i));
    const double factor = relaxation_.next(std::move(found));
    std::vector<double> values(motion.size());
    for (std::size_t i = 0; i < kComponents; ++i) {
      for (std::size_t at = 0; at < values.size(); ++at)
        values[at] = component(motion[by_tilt_[at]], i);
      slow_modes_[i].amplify(values);
      for (std::size_t at = 0; at < values.size(); ++at)
        component(motion[by_tilt_[at]], i) = factor * values[at];
    }
    return motion;
  }

  const JointProblem& problem_;
  Freedoms freedoms_;
  const distributed::Communicator& processes_;
  FieldOptions field_;
  measurement::Measurement measurement_;
  fit::Fit fit_;
  std::vector<std::size_t> by_tilt_;  // views in order of tilt
  Relaxation relaxation_;
  std::array<SlowModeAmplifier, kComponents> slow_modes_;
  LocalAlignment found_;
};

}  // namespace

LocalAlignment align_locally(const JointProblem& problem, const Freedoms& freedoms,
                             std::vector<ViewCorrection> start, std::span<const ViewWarp> motion,
                             const distributed::Communicator& processes) {
  for (std::size_t v = 0; v < start.size(); ++v)
    start[v] = with_motion(start[v], motion[v], freedoms);
  return LocalFit(problem, freedoms, std::move(start), processes).run();
}

}  // namespace tomofield::alignment
