#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tune/trial_settings.h"

namespace tomofield::report {

/// A place of the dial, and the trial whose weight is nearest to that of this place.
struct DialTrial {
  std::string place;            ///< "light", "medium", "strong"
  const tune::FitTrial* trial;  ///< of the search that chose the settings
  double factor;                ///< its weight over the chosen one, as --denoise takes it
};

/// Returns the trials that show what the dial does: those with the chosen penalty and corrections
/// whose weights are nearest to those of light, medium and strong. Returns none if they are not
/// three different trials. `tuned` must outlive the result.
std::vector<DialTrial> dial_trials(const tune::TunedFit& tuned);

/// Returns the factor of --denoise that a trial shows, and how that compares with the factor of its
/// place: "Factor 0.33: lighter than light (0.5)".
std::string caption_of(const DialTrial& shown);

/// Draws the sections of these trials in the contrast of the medium one, each with its
/// caption_of() (trial_sections.h). Removes the file and draws nothing if dial_trials() has none,
/// or if one of them has no section.
void write_dial_picture(const tune::TunedFit& tuned, double output_scale,
                        const std::filesystem::path& path);

}  // namespace tomofield::report
