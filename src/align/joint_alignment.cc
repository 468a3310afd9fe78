#include "align/joint_alignment.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "align/aligning_fit.h"
#include "align/gauge.h"
#include "align/local/local_registration.h"
#include "align/local/slow_modes.h"
#include "align/prediction_by_tilt.h"
#include "align/registration.h"
#include "align/relaxation.h"
#include "align/start/exposures.h"
#include "align/start/slab_pose_search.h"
#include "align/start/transmission_pitch.h"
#include "base/statistics.h"
#include "base/trace.h"
#include "fit/fit.h"
#include "fit/stages.h"
#include "geometry/tilt_geometry.h"

namespace tomofield::alignment {
namespace {

using geometry::ViewCorrection;

// Largest change of a shift at once, in pixels of the stage.
constexpr double kLongestStep = 2.0;
// Rotations, magnifications and tilts are looked for in pixels at most this many times as wide.
constexpr int kFreedomBin = 2;
// Tilts open only if it is very sure: a shift that the field blurs looks like an error of the tilt.
constexpr double kSureOfTilts = 5.0;
// Tilts are looked for in every second update with these pixels: they cost two more predictions.
constexpr int kTiltEvery = 2;
constexpr double kSurePay = 3.0;  // standard errors by which a freedom must pay

// A fit and the corrections of the views that it is made with.
class AligningFit {
 public:
  // Gives the views scales and offsets of their own if `may_scale` and their exposures differ.
  AligningFit(const JointProblem& problem, bool may_scale, std::vector<ViewCorrection> start,
              const distributed::Communicator& processes)
      : problem_(problem),
        processes_(processes),
        field_(aligning_field(problem.field)),
        measurement_(aligning_measurement(
            problem, start, fit::make_stages(field_, joint_fit(problem.seed)).front().bin, field_,
            processes)),
        fit_(measurement_, field_, fit_options(may_scale), processes) {
    found_.agreement.resize(start.size());
    // A start with rotations has errors of rotations.
    found_.freedoms.rotation = std::ranges::any_of(
        start, [](const ViewCorrection& correction) { return correction.rotation_rad != 0.0; });
    found_.corrections = std::move(start);
  }

  // Aligns in the first `num_epochs` epochs of the fit.
  JointAlignment run(std::int64_t num_epochs) {
    const FitInProgress in_progress{problem_,        field_,       found_.corrections,
                                    found_.steps_px, measurement_, fit_};
    run_with_updates(
        in_progress, num_epochs, [this](const fit::Stage& stage) { return update(stage); },
        processes_);
    return std::move(found_);
  }

  // Lets the views turn from the start on.
  void free_rotations() { found_.freedoms.rotation = true; }

  std::int64_t num_epochs() const { return fit_.num_epochs(); }
  std::vector<double> residuals() const {
    return inner_residuals(fit_, measurement_, fit_.stage());
  }

 private:
  // Returns the options of the fit. Scales of the views hide errors of shifts that vary slowly over
  // the tilts, so they are left out where they are not needed.
  FitOptions fit_options(bool may_scale) const {
    FitOptions options = joint_fit(problem_.seed);
    options.fit_view_scale = may_scale && exposures_differ(measurement_, processes_);
    return options;
  }

  // Registers every view.
  bool update(const fit::Stage& stage) {
    const base::TraceSpan span("register views");
    std::vector<ViewCorrection> steps = limited(register_views(stage), stage);
    std::vector<ViewCorrection> next = found_.corrections;
    for (std::size_t v = 0; v < next.size(); ++v) next[v] = next[v].then(steps[v]);
    remove_gauge(measurement_.geometry, next);
    found_.steps_px.push_back(rms_change(found_.corrections, next));
    found_.corrections = std::move(next);
    return true;
  }

  static double rms_change(const std::vector<ViewCorrection>& from,
                           const std::vector<ViewCorrection>& to) {
    double squares = 0.0;
    for (std::size_t v = 0; v < from.size(); ++v)
      squares += std::pow(to[v].shift_x_px - from[v].shift_x_px, 2) +
                 std::pow(to[v].shift_y_px - from[v].shift_y_px, 2);
    return std::sqrt(squares / 2 / static_cast<double>(from.size()));
  }

  // Returns the steps that are taken for what the registrations found.
  std::vector<ViewCorrection> limited(std::vector<ViewCorrection> steps, const fit::Stage& stage) {
    const std::vector<std::size_t> by_tilt =
        geometry::order_of_tilts(measurement_.geometry.tilt_deg);
    std::vector<double> shifts, found;
    for (const std::size_t view : by_tilt) {
      shifts.push_back(steps[view].shift_x_px);
      found.insert(found.end(), {steps[view].shift_x_px, steps[view].shift_y_px});
    }
    const double factor = relaxation_.next(std::move(found));
    slow_modes_.amplify(shifts);
    for (std::size_t i = 0; i < by_tilt.size(); ++i) steps[by_tilt[i]].shift_x_px = shifts[i];
    const double most = kLongestStep * stage.bin * measurement_.bin_factor;
    keep_axis(steps);
    for (ViewCorrection& step : steps) {
      for (double* shift : {&step.shift_x_px, &step.shift_y_px})
        *shift = std::clamp(factor * *shift, -most, most);
      step.rotation_rad *= factor;
      step.log_magnification *= factor;
      step.tilt_deg *= factor;
    }
    return steps;
  }

  // Takes the common rotation out of the steps unless the views agree on it. A field follows any
  // axis, so noise would turn it a little further with each update.
  static void keep_axis(std::vector<ViewCorrection>& steps) {
    std::vector<double> rotations;
    for (const ViewCorrection& step : steps) rotations.push_back(step.rotation_rad);
    const base::MeanGain common = base::mean_gain(rotations);
    if (std::abs(common.mean) > kSurePay * common.error) return;
    for (ViewCorrection& step : steps) step.rotation_rad -= common.mean;
  }

  // Predicts all views, some at a time, and returns what the registration to the predictions finds.
  std::vector<ViewCorrection> register_views(const fit::Stage& stage) {
    std::vector<std::optional<Registration>> registrations(found_.corrections.size());
    std::vector<LocalRegistration> local;
    const geometry::TiltGeometry& g = measurement_.geometry;
    SlabPoseSearch search(g.tilt_deg, g.hand, g.width / stage.bin, !problem_.field.with_margin);
    if (fit_.is_done())
      local.assign(registrations.size(), LocalRegistration(local_options(measurement_, stage)));
    std::vector<std::vector<float>> by_tilt;
    if (stage.bin == kFreedomBin && num_updates_++ % kTiltEvery == 0)
      by_tilt = predictions_by_tilt(measurement_, fit_);
    for_each_prediction(fit_, measurement_, stage, [&](std::size_t view, const ImagePair& images) {
      if (fit_.is_done()) search.add(view, images);
      ImagePair pair = images;
      if (!by_tilt.empty()) pair.by_tilt = by_tilt[view];
      registrations[view].emplace(pair, RegistrationOptions{},
                                  local.empty() ? nullptr : &local[view]);
    });
    if (fit_.is_done()) {
      found_.motion = motion_that_pays(local);
      find_pose(search);
    }
    if (stage.bin <= kFreedomBin) open_freedoms(registrations);
    std::vector<ViewCorrection> steps;
    for (std::size_t v = 0; v < registrations.size(); ++v) {
      const Registration& registration = *registrations[v];
      steps.push_back(registration.solve(found_.freedoms));
      found_.agreement[v] = {registration.correlation(), registration.shift_error(found_.freedoms)};
    }
    return steps;
  }

  // Returns the pitch that the mean intensities of dark views tell, if they see ice alone.
  std::optional<FoundPitch> pitch_of_ice() const {
    const ViewOptions& options = problem_.recorded.options();
    if (options.contrast != Contrast::kDark || !problem_.field.with_margin) return std::nullopt;
    const double empty_beam = problem_.recorded.empty_beam(), added = options.log_base;
    std::vector<double> intensities;
    for (const ViewSums& view : sums_of_views(measurement_, processes_)) {
      const double value = view.mean() * measurement_.unit;
      intensities.push_back(options.take_log ? (empty_beam + added) * std::exp(-value) - added
                                             : empty_beam - value);
    }
    return pitch_by_transmission(measurement_.geometry.tilt_deg, intensities,
                                 measurement_.geometry.thickness * measurement_.pixel_size_A);
  }

  // Finds thickness and pitch of the specimen in the aligned views of full width.
  void find_pose(const SlabPoseSearch& search) {
    const base::TraceSpan span("find pose");
    const double given_px = measurement_.geometry.thickness;
    const std::optional<FoundPitch> pitch = pitch_of_ice();
    found_.pose = search.find({.thickness_px = given_px}, pitch);
    if (!found_.pose && pitch)  // the thickness stays as unsure as it is
      found_.pose = FoundPose{.pose = {.thickness_px = given_px, .pitch_deg = pitch->deg},
                              .error = {.thickness_px = given_px, .pitch_deg = pitch->error_deg}};
    if (!found_.pose) return;
    found_.pose->pose.x_tilt_deg += problem_.plan.x_tilt_deg;
    found_.pose->pose.thickness_px *= measurement_.bin_factor;
    found_.pose->error.thickness_px *= measurement_.bin_factor;
  }

  // Opens each freedom that predicts pixels better which did not decide about it.
  void open_freedoms(const std::vector<std::optional<Registration>>& registrations) {
    for (bool Freedoms::*freedom :
         {&Freedoms::rotation, &Freedoms::magnification, &Freedoms::tilt}) {
      Freedoms with = found_.freedoms;
      with.*freedom = true;
      if (with == found_.freedoms) continue;
      if (pays(registrations, found_.freedoms, with)) found_.freedoms = with;
    }
  }

  // Returns true if the error of the views falls by enough standard errors to be no accident.
  // One is too few, because the question comes up at every update.
  static bool pays(const std::vector<std::optional<Registration>>& registrations,
                   const Freedoms& without, const Freedoms& with) {
    std::vector<double> gains;
    for (const auto& registration : registrations) {
      const double before = registration->predicted_error(without);
      if (before > 0.0) gains.push_back(1.0 - registration->predicted_error(with) / before);
    }
    return base::mean_gain(gains).exceeds(with.tilt && !without.tilt ? kSureOfTilts : kSurePay);
  }

  const JointProblem& problem_;
  const distributed::Communicator& processes_;
  FieldOptions field_;
  measurement::Measurement measurement_;
  fit::Fit fit_;
  Relaxation relaxation_;
  SlowModeAmplifier slow_modes_;
  int num_updates_ = 0;  // with pixels of kFreedomBin
  JointAlignment found_;
};

}  // namespace

FitOptions joint_fit(std::uint64_t seed) {
  constexpr int kCoarseEpochs = 80, kFineEpochs = 3;
  return aligning_fit(kCoarseEpochs, kFineEpochs, seed);
}

JointAlignment align_jointly(const JointProblem& problem, std::vector<ViewCorrection> start,
                             const distributed::Communicator& processes) {
  AligningFit fit(problem, /*may_scale=*/true, std::move(start), processes);
  return fit.run(fit.num_epochs());
}

std::vector<double> coarse_residuals(const JointProblem& problem,
                                     const std::vector<ViewCorrection>& start,
                                     const distributed::Communicator& processes) {
  AligningFit fit(problem, /*may_scale=*/false, start, processes);
  fit.free_rotations();
  fit.run(kResidualEpochs);
  return fit.residuals();
}

}  // namespace tomofield::alignment
