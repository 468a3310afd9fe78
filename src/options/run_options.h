#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "align/alignment_record.h"
#include "base/progress.h"
#include "measurement/prepare.h"
#include "measurement/view_transfers.h"
#include "option_table/setting.h"
#include "output/volume.h"
#include "tilt_series/tilt_series.h"
#include "tomofield/options.h"
#include "tune/automatic_choice.h"

namespace tomofield::options {

/// Fills in the options that follow from other options: leaves, epochs, learning rate, weights,
/// activation and the scale of views. If neither the penalty nor its weight is given, both stay
/// open, because trials choose them. `files` say whether a microscope filtered the views. Values
/// out of range stay as they are; faults() names them.
Options resolve(const SeriesFiles& files, const Options& requested);

/// A series of fewer views cannot spare any of them for trials.
constexpr int kFewestViewsOfTrials = 12;

/// Everything that a reconstruction is made from: the options, resolved, and what the alignment
/// before the fit adds to the files. run_options() makes it. Each layer takes its own section.
struct ReconstructOptions : Options {
  SeriesFiles files;
  std::shared_ptr<const io::ImageStack> images = {};  ///< views in memory, in place of files.stack
  /// [section]: changes of the alignment that the files give; empty: none.
  std::vector<geometry::ViewCorrection> corrections = {};
  std::vector<std::int64_t> left_out = {};                   ///< sections, beside views.exclude
  std::optional<alignment::AlignmentRecord> alignment = {};  ///< before the fit, if there was one
  bool has_output = true;  ///< the name of the output is that of the user, if it is not empty
  base::Stopwatch since_start = {};  ///< runs from run_options() on, before an alignment

  /// Returns how the tilt series is read.
  tilt_series::TiltSeriesOptions input() const;
  /// Returns the settings that trials choose or have chosen. They start from the values that they
  /// have.
  tune::OpenSettings open_settings() const;
  /// Returns true if the run also makes two fits of one half of the data each.
  bool makes_halves() const { return (files.even && files.odd) || fit.split_tilts; }
  /// Returns true if the run may be fitted by tiles, whose codes it keeps in a file.
  bool may_use_tiles() const { return !field.budget.empty() && !(field.tile_rows == 0); }
  /// Returns the options of the longest fit: that with the learned prior if it is left to a trial.
  ReconstructOptions with_open_prior() const;
  /// Returns true if trials choose the weight of total variation, which --denoise multiplies.
  bool chooses_weight() const { return fit.tune || fit.penalty.is_left_to_trials(); }
  /// Returns true if the fit filters views, which mixes their rows.
  bool filters_views() const {
    return measurement::wants_transfers(files, views) || fit.noise_model == NoiseModel::kColoured;
  }

  /// Returns the expected number of trials before the fit, which choose the settings `to_choose`; 0
  /// means that nothing is to be chosen, that there are too few views (kFewestViewsOfTrials), or
  /// that trials cannot predict them, which are rays of raw views.
  int num_trials(int num_fitted_views, const tune::OpenSettings& to_choose) const;
  /// Returns a sentence for each option that is out of range or does not go with another one.
  std::vector<std::string> faults() const;
  /// Returns a sentence for each option that a job of several processes cannot have.
  std::vector<std::string> faults_of_job() const;
};

/// Resolves the options and hands them to the layers below. Where trials choose an option, it gets
/// the value that the trials start from. A fit keeps that value if no trials are made.
ReconstructOptions run_options(const SeriesFiles& files, const Options& requested);

/// A strength of `--denoise` that has a name.
struct DenoisePlace {
  const char* name;
  double factor;
};
inline constexpr DenoisePlace kDenoisePlaces[] = {{"light", 0.5}, {"medium", 1.0}, {"strong", 2.0}};

/// Returns the factor by which `--denoise` multiplies the weight of total variation: light is 0.5,
/// medium is 1 and strong is 2; a number is itself. Throws Error for any other text, and for
/// numbers that are not from 0.05 to 20.
double denoise_factor(const std::string& text);

/// Returns the options of a fit with its weight of total variation multiplied by that factor. The
/// options of a run keep the weight that was given or chosen, so that they make the same fit when
/// they are given again.
FitOptions with_denoise(FitOptions fit);

}  // namespace tomofield::options
