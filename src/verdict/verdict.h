#pragma once

#include <optional>
#include <string>
#include <vector>

#include "evaluate/field_artefacts.h"
#include "fit/fit.h"
#include "measurement/measurement.h"
#include "tune/scores.h"
#include "verdict/defocus_check.h"
#include "verdict/view_agreement.h"

namespace tomofield::verdict {

/// The errors of views that a field was not fitted to, in units of their noise variance.
struct HeldOutSummary {
  double median = 0.0, worst = 0.0;
  double worst_tilt_deg = 0.0;
  bool is_of_trials = false;  ///< of the trials that chose the settings, not of the fit itself
};

/// Whether the learned prior ended the fit, and the gain that a trial found.
struct PriorSummary {
  bool is_used = false;
  /// By what part the prior lowers the error of held-out views in whole fits of some rows, as
  /// tune::difference_of_means() compares them. None if no trial was made.
  std::optional<tune::Difference> gain;
};

/// The variation of the density within the sections of the volume.
struct SectionProfile {
  /// Standard deviation in the outermost twentieth of the sections, at the face where it is
  /// smaller, over the median of the middle half.
  double faces = 0.0;
  /// Fraction of sections that vary by less than three tenths of those of which a fifth vary more:
  /// not of the most varied ones, because a layer of gold beads may vary much more than the rest.
  double empty_part = 0.0;
};
/// Returns the profile of the standard deviations of sections, from one face to the other.
SectionProfile section_profile(const std::vector<double>& deviation);

/// A fault of a run: what is off, and what to do.
struct Warning {
  std::string code;     ///< for programs; docs/verdict.md lists them
  std::string message;  ///< one sentence
};

/// What a finished fit tells of itself and of its input.
struct Verdict {
  double residual = 0.0;  ///< mean squared residual over the noise variance
  std::optional<HeldOutSummary> held_out;
  PriorSummary prior;
  evaluate::FieldArtefacts artefacts;
  SectionProfile sections;
  std::optional<ViewAgreement> views;   ///< none for views as recorded (ray engine)
  std::optional<DefocusCheck> defocus;  ///< of views with a contrast transfer
  double seconds = 0.0;
  double peak_GiB = 0.0;  ///< of the process that used most
  std::vector<Warning> warnings;
};

/// Returns the line that says how a run went.
std::string verdict_line(const Verdict& verdict);

/// Logs the line, and then each warning.
void log_verdict(const Verdict& verdict);

}  // namespace tomofield::verdict
