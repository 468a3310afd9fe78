#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "reconstruct/trial_settings.h"

namespace tomofield::reconstruction {

/// Returns the factor by which `--denoise` multiplies the weight of total variation: light is 0.5,
/// medium is 1 and strong is 2; a number is itself. Throws Error for any other text, and for
/// numbers that are not from 0.05 to 20.
double denoise_factor(const std::string& text);

/// A place of the dial, and the trial whose weight is nearest to that of this place.
struct DialTrial {
  std::string place;      ///< "light", "medium", "strong"
  const FitTrial* trial;  ///< of the search that chose the settings
  double factor;          ///< its weight over the chosen one, as --denoise takes it
};

/// Returns the trials that show what the dial does: those with the chosen penalty and corrections
/// whose weights are nearest to those of light, medium and strong. Returns none if they are not
/// three different trials. `tuned` must outlive the result.
std::vector<DialTrial> dial_trials(const TunedFit& tuned);

/// Returns the factor of --denoise that a trial shows, and how that compares with the factor of its
/// place: "Factor 0.33: lighter than light (0.5)".
std::string caption_of(const DialTrial& shown);

/// Draws the sections of these trials in the contrast of the medium one, each with its
/// caption_of() (trial_sections.h). Removes the file and draws nothing if dial_trials() has none,
/// or if one of them has no section.
void write_dial_picture(const TunedFit& tuned, double output_scale,
                        const std::filesystem::path& path);

}  // namespace tomofield::reconstruction
