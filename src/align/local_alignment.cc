#include "align/local_alignment.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "align/aligning_fit.h"
#include "align/gauge.h"
#include "align/local_gauge.h"
#include "align/local_registration.h"
#include "base/stopwatch.h"
#include "base/trace.h"
#include "fit/fit.h"

namespace tomofield::align {
namespace {

using geometry::ViewCorrection;
using geometry::ViewWarp;

// A registration to a field that was fitted to the view itself finds a part of the motion.
constexpr double kRelaxation = 1.3;
constexpr int kCoarseEpochs = 80, kFineEpochs = 4;

// Divides motion that a view shows into a correction of the whole view and the rest.
ViewCorrection step_for(const ViewWarp& motion, const Freedoms& freedoms) {
  const ViewWarp::Rigid rigid = motion.rigid_part();
  // The view shows at q what the prediction has at q + e(q), so the view is to be moved by −e.
  return {.shift_x_px = -rigid.shift[0],
          .shift_y_px = -rigid.shift[1],
          .rotation_rad = freedoms.rotation ? -rigid.rotation : 0.0,
          .log_magnification = freedoms.magnification ? -rigid.magnification : 0.0,
          .local = motion.without(rigid)};
}

double rms_change(const std::vector<ViewCorrection>& from, const std::vector<ViewCorrection>& to) {
  double squares = 0.0;
  for (std::size_t v = 0; v < from.size(); ++v) {
    ViewWarp change = *to[v].local;
    for (std::size_t i = 0; i < change.nodes.size(); ++i)
      for (std::size_t axis = 0; axis < 2; ++axis)
        change.nodes[i][axis] -= from[v].local->nodes[i][axis];
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
        measurement_(measurement::prepare_realigned(problem.recorded, start, problem.specimen,
                                                    problem.scratch_dir, fit::band_rows(field_),
                                                    processes)),
        fit_(measurement_, field_, aligning_fit(kCoarseEpochs, kFineEpochs, problem.seed),
             processes) {
    found_.corrections = std::move(start);
  }

  LocalAlignment run() {
    while (!fit_.is_done() && !found_.was_stopped) {
      const fit::Stage stage = fit_.stage();
      fit_.run(
          [](const fit::Fit& fit) { return fit.progress().step % fit.steps_per_epoch() != 0; });
      const std::int64_t epochs = fit_.progress().step / fit_.steps_per_epoch();
      found_.was_stopped = is_to_stop();
      if (is_update_due(stage, epochs, fit_.is_done())) update(stage);
    }
    return std::move(found_);
  }

 private:
  // Any process can stop all of them.
  bool is_to_stop() const {
    const bool asked = problem_.stop_requested && problem_.stop_requested();
    return processes_.allreduce_max(asked ? 1.0 : 0.0) > 0.0;
  }

  // Registers every view and goes on with the corrected ones.
  void update(const fit::Stage& stage) {
    const base::TraceSpan span("register local motion");
    const std::vector<ViewWarp> motion = register_views(stage);
    std::vector<ViewCorrection> next = found_.corrections;
    for (std::size_t v = 0; v < next.size(); ++v) {
      ViewWarp step = motion[v];
      for (ViewWarp::Vector& node : step.nodes)
        node = {kRelaxation * node[0], kRelaxation * node[1]};
      next[v] = next[v].then(step_for(step, freedoms_));
    }
    remove_gauge(measurement_.geometry, next);
    remove_specimen_warp(measurement_.geometry, next);
    found_.steps_px.push_back(rms_change(found_.corrections, next));
    fprintf(stderr, "bin %d step %.4f\n", stage.bin, found_.steps_px.back());
    found_.corrections = std::move(next);
    if (fit_.is_done()) return;
    measurement::realign(problem_.recorded, found_.corrections, problem_.scratch_dir,
                         fit::band_rows(field_), processes_, measurement_);
    fit_.reread_measurement();
  }

  std::vector<ViewWarp> register_views(const fit::Stage& stage) const {
    std::vector<ViewWarp> motion(found_.corrections.size());
    const LocalRegistrationOptions options = local_options(measurement_, stage);
    for_each_prediction(fit_, measurement_, stage, [&](std::size_t view, const ImagePair& images) {
      LocalRegistration local(options);
      const Registration whole(images, {}, &local);
      motion[view] = local.solve(*found_.corrections[view].local);
    });
    return motion;
  }

  const JointProblem& problem_;
  Freedoms freedoms_;
  const distributed::Communicator& processes_;
  fit::FieldOptions field_;
  measurement::Measurement measurement_;
  fit::Fit fit_;
  LocalAlignment found_;
};

}  // namespace

LocalAlignment align_locally(const JointProblem& problem, const Freedoms& freedoms,
                             std::vector<ViewCorrection> start,
                             const distributed::Communicator& processes) {
  return LocalFit(problem, freedoms, std::move(start), processes).run();
}

}  // namespace tomofield::align
